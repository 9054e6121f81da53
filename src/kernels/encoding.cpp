// Python bindings of the encoding kernels, and the second half of regional HOG: block norms.
#include "bindings.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "encoding_entropy.h"
#include "encoding_hog.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace retraverse;

namespace {

using Grey = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Floats = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Doubles = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Names of the instruction sets this processor runs, the fastest first.
std::vector<std::string> instruction_sets() {
    std::vector<std::string> names;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        names.emplace_back("avx512");
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) names.emplace_back("avx2");
#endif
    names.emplace_back("plain");
    return names;
}

CellHistograms *cell_kernel(const std::string &wanted) {
    static const std::vector<std::string> present = instruction_sets();
    const std::string name = wanted == "auto" ? present.front() : wanted;
    if (std::find(present.begin(), present.end(), name) == present.end())
        throw nb::value_error("this processor does not run that instruction set");
#if defined(__x86_64__)
    if (name == "avx512") return hog_avx512::cell_histograms;
    if (name == "avx2") return hog_avx2::cell_histograms;
#endif
    return hog_plain::cell_histograms;
}

// sqrt(level / largest) * 255 for every level, in units of 2^-16. A black picture stays black.
std::array<std::int32_t, 256> gamma_table(const std::uint8_t *grey, std::size_t n) {
    const int largest = n ? *std::max_element(grey, grey + n) : 0;
    std::array<std::int32_t, 256> table{};
    for (int level = 1; level <= largest; ++level)
        table[level] = static_cast<std::int32_t>(std::nearbyint(
            std::sqrt(static_cast<double>(level) / largest) * 255.0 * 65536.0));
    return table;
}

// Blocks of 2 x 2 cells, one cell apart: their four histograms side by side, of length 1.
void normalise_blocks(const float *cells, int n_cells, int bins, float *blocks) {
    std::vector<float> energy(static_cast<std::size_t>(n_cells) * n_cells);
    for (std::size_t c = 0; c < energy.size(); ++c)
        for (int b = 0; b < bins; ++b) energy[c] += cells[c * bins + b] * cells[c * bins + b];
    for (int row = 0; row + 1 < n_cells; ++row) {
        for (int column = 0; column + 1 < n_cells; ++column) {
            const int first = row * n_cells + column;
            const int corners[4] = {first, first + 1, first + n_cells, first + n_cells + 1};
            float total = 0.0f;
            for (const int corner : corners) total += energy[corner];
            const float scale = total > 0.0f ? 1.0f / std::sqrt(total) : 0.0f;
            for (const int corner : corners) {
                const float *histogram = cells + static_cast<std::size_t>(corner) * bins;
                for (int b = 0; b < bins; ++b) *blocks++ = histogram[b] * scale;
            }
        }
    }
}

// Words of scratch whose first lies on a cache line.
class Scratch {
public:
    explicit Scratch(std::size_t words) : words_(words + line / sizeof(std::int32_t)) {
        std::size_t space = words_.size() * sizeof(std::int32_t);
        first_ = words_.data();
        std::align(line, words * sizeof(std::int32_t), first_, space);
    }
    std::int32_t *data() { return static_cast<std::int32_t *>(first_); }

private:
    static constexpr std::size_t line = 64;
    std::vector<std::int32_t> words_;
    void *first_;
};

void regional_hog(Grey grey, Floats descriptor, int cell, int bins, bool is_signed,
                  bool is_euclidean, const std::string &instruction_set) {
    CellHistograms *const cell_histograms = cell_kernel(instruction_set);
    const HogShape shape{static_cast<int>(grey.shape(0)), cell, bins, is_signed, is_euclidean};
    const std::uint8_t *pixels = grey.data();
    float *blocks = descriptor.data();
    nb::gil_scoped_release released;
    const auto size = static_cast<std::size_t>(shape.size);
    const int n_cells = shape.size / cell;
    const auto gamma = gamma_table(pixels, size * size);
    Scratch scratch(size * (scratch_rows + bins) + scratch_margin);
    std::vector<float> cells(static_cast<std::size_t>(n_cells) * n_cells * bins);
    cell_histograms(pixels, gamma.data(), shape, scratch.data(), cells.data());
    normalise_blocks(cells.data(), n_cells, bins, blocks);
}

void entropy(Grey image, Doubles map, int radius) {
    const std::uint8_t *pixels = image.data();
    double *bits = map.data();
    const int height = static_cast<int>(image.shape(0)), width = static_cast<int>(image.shape(1));
    nb::gil_scoped_release released;
    local_entropy(pixels, height, width, radius, bits);
}

} // namespace

void bind_encoding(nb::module_ &module) {
    module.def("encoding_instruction_sets", &instruction_sets);
    module.def("regional_hog", &regional_hog, "grey"_a.noconvert(), "descriptor"_a.noconvert(),
               "cell"_a, "bins"_a, "is_signed"_a, "is_euclidean"_a, "instruction_set"_a = "auto");
    module.def("local_entropy", &entropy, "image"_a.noconvert(), "map"_a.noconvert(), "radius"_a);
}
