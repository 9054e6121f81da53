// Compares every instruction set of the processor it runs on with the definitions of thumbnail
// differences and mutual nearest keypoints. Needs no Python: see tools/check-neon.
#include "cpu.h"
#include "keypoints.h"
#include "thumbnails.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

using namespace retraverse;

namespace {

std::vector<std::uint8_t> bytes(std::mt19937 &random, std::size_t count, unsigned levels) {
    std::vector<std::uint8_t> all(count);
    for (std::uint8_t &value : all)
        value = static_cast<std::uint8_t>(random() % levels);
    return all;
}

bool differences_are_right(const std::string &set, Difference difference, std::size_t length) {
    constexpr std::size_t Q = 3, R = 11;
    std::mt19937 random(static_cast<unsigned>(length));
    const auto queries = bytes(random, Q * length, 256), references = bytes(random, R * length, 256);
    std::vector<std::uint32_t> out(Q * R);
    thumbnail_differences({difference, queries.data(), references.data(), out.data(), Q, R, length},
                          2, set);
    for (std::size_t i = 0; i < Q * R; ++i) {
        std::uint32_t expected = 0;
        for (std::size_t p = 0; p < length; ++p) {
            const int apart = queries[i / R * length + p] - references[i % R * length + p];
            expected += difference == Difference::saturating ? std::max(apart, 0) : std::abs(apart);
        }
        if (out[i] != expected)
            return false;
    }
    return true;
}

int distance(const std::uint8_t *a, const std::uint8_t *b) {
    int bits = 0;
    for (int i = 0; i < 32; ++i)
        bits += __builtin_popcount(a[i] ^ b[i]);
    return bits;
}

// The first of the `count` descriptors that is nearest to `one`.
int nearest(const std::uint8_t *one, const std::uint8_t *all, int count) {
    int best = 0;
    for (int i = 1; i < count; ++i)
        if (distance(one, all + 32 * i) < distance(one, all + 32 * best))
            best = i;
    return best;
}

bool matches_are_right(const std::string &set, unsigned levels, int limit) {
    constexpr std::int32_t n = 45, m = 53;
    std::mt19937 random(levels);
    const auto query = bytes(random, 32 * n, levels), reference = bytes(random, 32 * m, levels);
    std::int32_t out = -1, expected = 0;
    keypoint_matches({query.data(), &n, reference.data(), &m, &out, 1, n, 1, m, limit}, 1, set);
    for (int i = 0; i < n; ++i) {
        const int j = nearest(&query[32 * i], reference.data(), m);
        expected += nearest(&reference[32 * j], query.data(), n) == i &&
                    distance(&query[32 * i], &reference[32 * j]) <= limit;
    }
    return out == expected;
}

} // namespace

int main() {
    int passed = 0, failed = 0;
    const auto count = [&](bool right) { ++(right ? passed : failed); };
    for (InstructionSet set : instruction_sets()) {
        for (std::size_t length : {1, 15, 64, 100, 2048})
            for (Difference difference : {Difference::absolute, Difference::saturating})
                count(differences_are_right(name_of(set), difference, length));
        for (unsigned levels : {2, 3, 256})
            for (int limit : {256, 100, 10})
                count(matches_are_right(name_of(set), levels, limit));
    }
    std::printf("thumbnails and keypoints, newest set %s: %d passed, %d failed\n",
                name_of(instruction_sets().front()), passed, failed);
    return failed == 0 ? 0 : 1;
}
