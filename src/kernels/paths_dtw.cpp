// Dynamic time warping: the cheapest monotone path through a matrix of costs.
//
// Costs are rounded to multiples of `quantum`, a power of two chosen by the caller so that no sum
// along a path needs more than 53 bits: paths of equal cost then tie exactly, whatever the order
// of the additions, and the NumPy twin, which adds in another order, finds the same path.
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

using Costs = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Steps = nb::ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// How a path came to a cell; ties are decided in this order.
enum Step : std::uint8_t { diagonal = 0, same_reference = 1, same_query = 2, start = 3 };

// The cheaper way down from the row before, for every cell.
void enter_row(const double *__restrict before, std::size_t n, double *__restrict entering,
               std::uint8_t *__restrict step) {
    entering[0] = before[0];
    step[0] = same_reference;
    for (std::size_t j = 1; j < n; ++j) {
        const bool across = before[j - 1] <= before[j];
        entering[j] = across ? before[j - 1] : before[j];
        step[j] = across ? diagonal : same_reference;
    }
}

// Adds each cell's cost, and the ways along the row where they are cheaper still.
void cross_row(const float *__restrict cost, double shift, std::size_t n,
               double *__restrict value, std::uint8_t *__restrict step) {
    double left = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < n; ++j) {
        const bool along = left < value[j];
        const double before = along ? left : value[j];
        step[j] = along ? static_cast<std::uint8_t>(same_query) : step[j];
        left = before + ((cost[j] + shift) - shift);
        value[j] = left;
    }
}

// Writes how the best path came to each cell; returns the column where the best path ends. An
// `open` path begins and ends at any column, else it runs from corner to corner.
std::int64_t dtw(Costs costs, double quantum, bool open, Steps steps) {
    const std::size_t n_queries = costs.shape(0), n = costs.shape(1);
    const float *cost = costs.data();
    std::uint8_t *step = steps.data();
    const double shift = std::ldexp(1.5, 52) * quantum;
    nb::gil_scoped_release released;
    std::vector<double> before(n), value(n, open ? 0.0 : std::numeric_limits<double>::infinity());
    value[0] = 0.0;
    std::fill(step, step + n, static_cast<std::uint8_t>(start));
    if (open)
        for (std::size_t j = 0; j < n; ++j) value[j] = (cost[j] + shift) - shift;
    else
        cross_row(cost, shift, n, value.data(), step);
    for (std::size_t i = 1; i < n_queries; ++i) {
        std::swap(before, value);
        enter_row(before.data(), n, value.data(), step + i * n);
        cross_row(cost + i * n, shift, n, value.data(), step + i * n);
    }
    if (!open) return static_cast<std::int64_t>(n) - 1;
    return std::min_element(value.begin(), value.end()) - value.begin();
}

} // namespace

void bind_dtw(nb::module_ &module) {
    module.def("dtw", &dtw, "costs"_a.noconvert(), "quantum"_a, "open"_a, "steps"_a.noconvert(),
               "Write how the cheapest path came to each cell; return the column where it ends.");
}
