// Regional HOG, first half: from grey pixels to one orientation histogram per cell.
//
// Each instruction set compiles its own copy of encoding_hog_core.h under its own namespace. No
// function is inline here: the linker would keep one copy for all of them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace retraverse {

struct HogShape {
    int size;          // side of the square picture; a multiple of `cell`, at least 4
    int cell;          // side of a cell
    int bins;          // orientations per cell
    bool is_signed;    // angles over 360 degrees, else over 180
    bool is_euclidean; // magnitude sqrt(dx^2 + dy^2), else |dx + dy|
};

// The kernels need size * (scratch_rows + bins) + scratch_margin words of scratch: two rings of
// five filtered rows, magnitude and position of one row, the votes of one row of cells, and one
// row with its margins. Best aligned to 64 bytes.
constexpr int scratch_rows = 13, scratch_margin = 4;

// grey: size x size; gamma: 256 fixed-point levels; histograms: cells x cells x bins, written.
// Magnitudes are in units of the gamma table; the block norm takes the unit away.
using CellHistograms = void(const std::uint8_t *grey, const std::int32_t *gamma,
                            const HogShape &shape, std::int32_t *scratch, float *histograms);

namespace hog_plain {
CellHistograms cell_histograms;
}
namespace hog_avx2 {
CellHistograms cell_histograms;
}
namespace hog_avx512 {
CellHistograms cell_histograms;
}

} // namespace retraverse
