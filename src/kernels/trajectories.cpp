// Straight trajectories of several slopes through a matrix of differences, as SeqSLAM looks for.
#include "bindings.h"
#include "threads.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Differences = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Offsets = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Sums = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Index = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

constexpr float none = std::numeric_limits<float>::infinity();

struct Row {
    std::vector<float> sum, best;
    std::vector<std::int32_t> slope;
    explicit Row(std::size_t n) : sum(n), best(n), slope(n) {}
};

// best[r] = the least sum over all slopes of the trajectory that is anchored at reference r, and
// `slope` which it was; infinite where every one of them leaves the matrix.
void search_window(const float *first_row, std::size_t n, const std::int64_t *offsets,
                   std::size_t n_slopes, std::size_t n_steps, Row &row) {
    std::fill(row.best.begin(), row.best.end(), none);
    std::fill(row.slope.begin(), row.slope.end(), 0);
    for (std::size_t s = 0; s < n_slopes; ++s, offsets += n_steps) {
        const auto [low, high] = std::minmax_element(offsets, offsets + n_steps);
        const std::int64_t first = std::max<std::int64_t>(0, -*low);
        const std::int64_t end = static_cast<std::int64_t>(n) - std::max<std::int64_t>(0, *high);
        float *__restrict sum = row.sum.data();
        std::fill(row.sum.begin(), row.sum.end(), 0.0f);
        for (std::size_t t = 0; t < n_steps; ++t) {
            const float *__restrict step = first_row + t * n;
            const std::int64_t offset = offsets[t];
            for (std::int64_t r = first; r < end; ++r) sum[r] += step[r + offset];
        }
        float *__restrict best = row.best.data();
        std::int32_t *__restrict slope = row.slope.data();
        for (std::int64_t r = first; r < end; ++r) {
            const float known = best[r];
            // A mask, not a condition: the compiler would make it a branch and use no vectors.
            const std::int32_t better = -static_cast<std::int32_t>(sum[r] < known);
            best[r] = sum[r] < known ? sum[r] : known;
            slope[r] ^= (slope[r] ^ static_cast<std::int32_t>(s)) & better;
        }
    }
}

float least_outside(const std::vector<float> &values, std::int64_t centre, std::int64_t radius) {
    const auto n = static_cast<std::int64_t>(values.size());
    const auto before = values.begin() + std::max<std::int64_t>(0, centre - radius);
    const auto after = values.begin() + std::min(n, centre + radius + 1);
    float least = none;
    if (before != values.begin()) least = *std::min_element(values.begin(), before);
    if (after != values.end()) least = std::min(least, *std::min_element(after, values.end()));
    return least;
}

void best_trajectories(Differences differences, Offsets offsets, std::int64_t radius,
                       unsigned threads, Index anchor, Index slope, Sums best, Sums second) {
    const std::size_t n = differences.shape(1), n_windows = anchor.shape(0);
    const std::size_t n_slopes = offsets.shape(0), n_steps = offsets.shape(1);
    const float *data = differences.data();
    const std::int64_t *steps = offsets.data();
    std::int64_t *anchors = anchor.data(), *slopes = slope.data();
    float *bests = best.data(), *seconds = second.data();
    nb::gil_scoped_release released;
    const double work = static_cast<double>(n_windows * n * n_slopes) * n_steps;
    threads = retraverse::worthwhile_threads(threads, work, 1e6);
    std::vector<Row> rows(threads, Row(n));
    retraverse::parallel_for(n_windows, threads, [&](std::size_t window, unsigned worker) {
        Row &row = rows[worker];
        search_window(data + window * n, n, steps, n_slopes, n_steps, row);
        const std::size_t at =
            std::min_element(row.best.begin(), row.best.end()) - row.best.begin();
        anchors[window] = static_cast<std::int64_t>(at);
        slopes[window] = row.slope[at];
        bests[window] = row.best[at];
        seconds[window] = least_outside(row.best, anchors[window], radius);
    });
}

} // namespace

void bind_trajectories(nb::module_ &module) {
    module.def("best_trajectories", &best_trajectories, "differences"_a.noconvert(),
               "offsets"_a.noconvert(), "radius"_a, "threads"_a, "anchor"_a.noconvert(),
               "slope"_a.noconvert(), "best"_a.noconvert(), "second"_a.noconvert());
}
