// Regional convolutional matching: how well each region of a query finds its like in a reference.
//
//     out[m, r] = sum over g of weights[m, g] * max over n of <query[g], references[r, n]>
//
// This is the product of two descriptor matrices with the row maxima taken while the product is
// still in registers: of its G x N values none reaches memory, only the G maxima do.
//
// How it is laid out. The vector registers run along the *query* regions: the query is transposed
// once a call into panels of some 64 regions, and a reference is read as it lies in the map, one
// word broadcast at a time. So nothing is rearranged per reference, and a maximum over reference
// regions is one vector instruction per register, with no shuffling across lanes. A word is the
// 4 bytes that one lane takes in one step: 1 float, 4 bytes, or 2 bytes widened to 16 bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace retraverse {

enum class Element { float32, uint8 };

struct RegionalProblem {
    Element element;
    const void *query;      // (query_regions, length)
    const void *references; // (references, regions, length)
    const float *weights;   // (rows, query_regions)
    float *out;             // (rows, references)
    std::size_t query_regions, n_references, regions, length, rows;
};

constexpr std::size_t all_finite = static_cast<std::size_t>(-1);

// Solve on `threads` threads with the newest kernel up to `instruction_set` ("" = the newest here).
// Returns `all_finite`, or the first reference that holds NaN or infinity, whose scores mean
// nothing. uint8 values are value * 255; their scores are divided by 255 squared.
// Throws std::invalid_argument for an instruction set that cannot run here.
std::size_t regional_scores(const RegionalProblem &problem, unsigned threads,
                            const std::string &instruction_set);

} // namespace retraverse
