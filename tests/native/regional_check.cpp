// Compares every instruction set of the processor it runs on with the definition, term by term.
// Needs no Python, so that it can run on an emulated processor: see tools/check-neon.
#include "cpu.h"
#include "regional.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

using namespace retraverse;

namespace {

struct Shape {
    std::size_t G, N, L, R, M;
};

template <class T> std::vector<T> values(std::mt19937 &random, std::size_t count, T largest) {
    std::vector<T> all(count);
    for (T &value : all)
        value = static_cast<T>(largest * (random() / 4294967296.0));
    return all;
}

template <class T>
double expected(const Shape &s, const std::vector<T> &query, const std::vector<T> &references,
                const std::vector<float> &weights, std::size_t m, std::size_t r) {
    double score = 0;
    for (std::size_t g = 0; g < s.G; ++g) {
        double best = -INFINITY;
        for (std::size_t n = 0; n < s.N; ++n) {
            double product = 0;
            for (std::size_t l = 0; l < s.L; ++l)
                product += 1.0 * query[g * s.L + l] * references[(r * s.N + n) * s.L + l];
            best = std::max(best, product);
        }
        score += weights[m * s.G + g] * best;
    }
    return score / (sizeof(T) == 1 ? 255.0 * 255.0 : 1.0);
}

// Returns the largest relative error, over all references and rows.
template <class T> double error(const Shape &s, const std::string &set, T largest) {
    std::mt19937 random(static_cast<unsigned>(s.G * 31 + s.N * 7 + s.L));
    const auto query = values<T>(random, s.G * s.L, largest);
    const auto references = values<T>(random, s.R * s.N * s.L, largest);
    auto weights = values<float>(random, s.M * s.G, 1.0f);
    for (std::size_t i = 0; i < weights.size(); i += 3)
        weights[i] = 0;
    std::vector<float> out(s.M * s.R);
    const RegionalProblem problem{sizeof(T) == 1 ? Element::uint8 : Element::float32,
                                  query.data(),
                                  references.data(),
                                  weights.data(),
                                  out.data(),
                                  s.G,
                                  s.R,
                                  s.N,
                                  s.L,
                                  s.M};
    if (regional_scores(problem, 2, set) != all_finite)
        return INFINITY;
    double worst = 0;
    for (std::size_t m = 0; m < s.M; ++m)
        for (std::size_t r = 0; r < s.R; ++r) {
            const double right = expected(s, query, references, weights, m, r);
            worst = std::max(worst, std::abs(out[m * s.R + r] - right) / std::max(1e-3, right));
        }
    return worst;
}

// Whether a NaN is found wherever it lies in the second of two references.
bool finds_nan(const std::string &set) {
    constexpr std::size_t N = 5, L = 31;
    std::vector<float> query(L, 1.0f), weights(1, 1.0f), out(2);
    for (std::size_t place = 0; place < N * L; ++place) {
        std::vector<float> references(2 * N * L, 1.0f);
        references[N * L + place] = NAN;
        const RegionalProblem problem{Element::float32, query.data(), references.data(),
                                      weights.data(),   out.data(),   1, 2, N, L, 1};
        if (regional_scores(problem, 1, set) != 1)
            return false;
    }
    return true;
}

} // namespace

int main() {
    const Shape shapes[] = {{1, 1, 1, 1, 1},    {5, 7, 36, 2, 3},   {70, 9, 64, 3, 1},
                            {33, 49, 32, 2, 2}, {81, 225, 32, 2, 3}, {16, 31, 8, 4, 1},
                            {130, 65, 33, 1, 2}, {3, 32, 130, 2, 1}, {49, 1, 128, 5, 2}};
    int passed = 0, failed = 0;
    for (InstructionSet set : instruction_sets()) {
        ++(finds_nan(name_of(set)) ? passed : failed);
        for (const Shape &s : shapes) {
            const double floats = error<float>(s, name_of(set), 1.0f);
            const double bytes = error<std::uint8_t>(s, name_of(set), 255);
            const bool right = floats < 2e-6 && bytes < 1e-6;
            ++(right ? passed : failed);
            if (!right)
                std::printf("%s G=%zu N=%zu L=%zu: relative error %g (floats), %g (bytes)\n",
                            name_of(set), s.G, s.N, s.L, floats, bytes);
        }
    }
    std::printf("regional kernels, newest set %s: %d passed, %d failed\n",
                name_of(instruction_sets().front()), passed, failed);
    return failed == 0 ? 0 : 1;
}
