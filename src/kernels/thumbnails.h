// Sums of pixel differences: every query thumbnail against every reference thumbnail.
//
//     absolute:   out[q, r] = sum over p of |query[q, p] - reference[r, p]|
//     saturating: out[q, r] = sum over p of max(query[q, p] - reference[r, p], 0)
//
// How it is laid out. Processors sum byte differences 8 at a time in one instruction, so the loop
// is bound by memory unless thumbnails are used several times once they are near: a tile of
// references that fits the second cache meets all queries, four references at a time.
#pragma once

#include "thumbnails_kernel.h"

#include <string>

namespace retraverse {

struct ThumbnailProblem {
    Difference difference;
    const std::uint8_t *queries;    // (n_queries, length)
    const std::uint8_t *references; // (n_references, length)
    std::uint32_t *out;             // (n_queries, n_references)
    std::size_t n_queries, n_references, length;
};

// Solve on `threads` threads with the newest kernel up to `instruction_set` ("" = the newest here).
// Throws std::invalid_argument for an instruction set that cannot run here.
void thumbnail_differences(const ThumbnailProblem &problem, unsigned threads,
                           const std::string &instruction_set);

} // namespace retraverse
