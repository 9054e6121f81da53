// Sequence scores from a similarity matrix: running sums along its diagonals.
//
// Every entry is first rounded to a multiple of `quantum`, a power of two chosen by the caller so
// that no sum of a whole diagonal needs more than 53 bits. Sums and differences of sums are then
// exact: no drift over a long traverse, and windows of equal content tie exactly, whatever their
// place and whichever way their sum was come by.
#include "bindings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Similarity = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Sums = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using SumsOut = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Scores = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Score = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Index = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Lengths = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Adding and taking away 1.5 * 2^52 quanta leaves the nearest multiple of the quantum.
struct Rounding {
    double shift;
    explicit Rounding(double quantum) : shift(std::ldexp(1.5, 52) * quantum) {}
    double operator()(float value) const { return (value + shift) - shift; }
};

// after[j + 1] = before[j] + row[j], the sums one step further down every diagonal; where the
// window is full, what is `length` steps back (in `leaving`) drops out.
void advance(const double *__restrict before, const float *__restrict row,
             const float *__restrict leaving, std::size_t n, std::size_t length, Rounding round,
             double *__restrict after) {
    const std::size_t growing = leaving ? std::min(length, n) : n;
    for (std::size_t j = 0; j < growing; ++j) after[j + 1] = before[j] + round(row[j]);
    for (std::size_t j = growing; j < n; ++j)
        after[j + 1] = before[j] + (round(row[j]) - round(leaving[j - length]));
}

double largest(const double *sums, std::size_t n) {
    constexpr std::size_t lanes = 8;  // independent maxima, so that the compiler uses vectors
    double best[lanes];
    std::fill(best, best + lanes, -std::numeric_limits<double>::infinity());
    std::size_t j = 0;
    for (; j + lanes <= n; j += lanes)
        for (std::size_t k = 0; k < lanes; ++k)
            best[k] = sums[j + k] > best[k] ? sums[j + k] : best[k];
    for (; j < n; ++j) best[0] = std::max(best[0], sums[j]);
    return *std::max_element(best, best + lanes);
}

struct Best {
    std::int64_t reference;
    float score;
};

// The first window whose mean, as float32, is the greatest. Means at or below the float32 just
// under the best one cannot round to it, so the division is spared almost everywhere.
Best first_best(const double *sums, std::size_t n, std::int64_t length) {
    const auto frames = static_cast<double>(length);
    const auto score = static_cast<float>(largest(sums, n) / frames);
    const float below = std::nextafter(score, -std::numeric_limits<float>::infinity());
    const double too_low = static_cast<double>(below) * frames;
    std::size_t j = 0;
    while (sums[j] <= too_low || static_cast<float>(sums[j] / frames) != score) ++j;
    return {static_cast<std::int64_t>(j), score};
}

// Calls take(first query, sums of its windows) for each window start, in O(Q R) for any length
// and with two rows of memory.
template <class Take>
void each_window(Similarity similarity, std::size_t length, double quantum, Take take) {
    const std::size_t n_queries = similarity.shape(0), n = similarity.shape(1);
    const float *data = similarity.data();
    const Rounding round(quantum);
    std::vector<double> before(n + 1), after(n + 1);
    for (std::size_t i = 0; i < n_queries; ++i) {
        const float *leaving = i >= length ? data + (i - length) * n : nullptr;
        advance(before.data(), data + i * n, leaving, n, length, round, after.data());
        if (i + 1 >= length) take(i + 1 - length, after.data() + length);
        std::swap(before, after);
    }
}

void diagonal_scores(Similarity similarity, std::int64_t length, double quantum, Scores scores) {
    const std::size_t width = scores.shape(1);
    float *out = scores.data();
    nb::gil_scoped_release released;
    each_window(similarity, length, quantum, [&](std::size_t query, const double *sums) {
        for (std::size_t j = 0; j < width; ++j)
            out[query * width + j] = static_cast<float>(sums[j] / static_cast<double>(length));
    });
}

void best_diagonals(Similarity similarity, std::int64_t length, double quantum, Index reference,
                    Score score) {
    const std::size_t width = similarity.shape(1) + 1 - length;
    std::int64_t *references = reference.data();
    float *scores = score.data();
    nb::gil_scoped_release released;
    each_window(similarity, length, quantum, [&](std::size_t query, const double *sums) {
        const Best best = first_best(sums, width, length);
        references[query] = best.reference;
        scores[query] = best.score;
    });
}

// sums[i + 1][j + 1] = similarity[i][j] + sums[i][j]; first row and column 0.
void diagonal_sums(Similarity similarity, double quantum, SumsOut sums) {
    const std::size_t n_queries = similarity.shape(0), n = similarity.shape(1);
    const float *data = similarity.data();
    double *out = sums.data();
    nb::gil_scoped_release released;
    const Rounding round(quantum);
    std::fill(out, out + n + 1, 0.0);
    for (std::size_t i = 0; i < n_queries; ++i) {
        double *before = out + i * (n + 1), *after = before + n + 1;
        after[0] = 0.0;
        advance(before, data + i * n, nullptr, n, n, round, after);
    }
}

// Sums of the windows of `length` frames that start at `query`, from the whole diagonals' sums.
void window_sums(const double *sums, std::size_t stride, std::size_t query, std::size_t length,
                 std::size_t width, double *__restrict out) {
    const double *first = sums + query * stride, *last = first + length * stride + length;
    for (std::size_t j = 0; j < width; ++j) out[j] = last[j] - first[j];
}

void scores_from_sums(Sums sums, std::int64_t length, Scores scores) {
    const std::size_t stride = sums.shape(1), width = scores.shape(1);
    const double *data = sums.data();
    float *out = scores.data();
    const std::size_t n_windows = scores.shape(0);
    nb::gil_scoped_release released;
    std::vector<double> row(width);
    for (std::size_t query = 0; query < n_windows; ++query) {
        window_sums(data, stride, query, length, width, row.data());
        for (std::size_t j = 0; j < width; ++j)
            *out++ = static_cast<float>(row[j] / static_cast<double>(length));
    }
}

void best_from_sums(Sums sums, Lengths lengths, Index reference, Score score) {
    const std::size_t stride = sums.shape(1), n_windows = lengths.shape(0);
    const double *data = sums.data();
    const std::int64_t *length = lengths.data();
    std::int64_t *references = reference.data();
    float *scores = score.data();
    nb::gil_scoped_release released;
    std::vector<double> row(stride);
    for (std::size_t query = 0; query < n_windows; ++query) {
        const std::size_t width = stride - static_cast<std::size_t>(length[query]);
        window_sums(data, stride, query, length[query], width, row.data());
        const Best best = first_best(row.data(), width, length[query]);
        references[query] = best.reference;
        scores[query] = best.score;
    }
}

} // namespace

void bind_diagonal(nb::module_ &module) {
    module.def("diagonal_scores", &diagonal_scores, "similarity"_a.noconvert(), "length"_a,
               "quantum"_a, "scores"_a.noconvert());
    module.def("best_diagonals", &best_diagonals, "similarity"_a.noconvert(), "length"_a,
               "quantum"_a, "reference"_a.noconvert(), "score"_a.noconvert());
    module.def("diagonal_sums", &diagonal_sums, "similarity"_a.noconvert(), "quantum"_a,
               "sums"_a.noconvert());
    module.def("scores_from_sums", &scores_from_sums, "sums"_a.noconvert(), "length"_a,
               "scores"_a.noconvert());
    module.def("best_from_sums", &best_from_sums, "sums"_a.noconvert(), "lengths"_a.noconvert(),
               "reference"_a.noconvert(), "score"_a.noconvert());
}
