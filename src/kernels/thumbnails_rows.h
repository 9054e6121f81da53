// One query against many references, written once for every instruction set.
//
// `Vector` brings the registers:
//     Vector::bytes                              how many pixels one holds
//     Vector::Pixels, Vector::load(address)      a vector of pixels
//     Vector::Sums, Vector::zero()               sums of 64 bits each
//     Vector::add<difference>(sums, q, r)        sums plus the differences of two vectors
//     Vector::total(sums)
// Everything lies in an unnamed namespace: each file compiles its own, with its own flags.
#pragma once

#include "thumbnails_kernel.h"

namespace retraverse {
namespace {

template <Difference difference> std::uint32_t pixel_difference(std::uint8_t q, std::uint8_t r) {
    if (difference == Difference::saturating)
        return q > r ? q - r : 0;
    return q > r ? q - r : r - q;
}

// `count` references at once: each vector of the query is loaded once for all of them, and their
// sums do not wait for one another.
template <class Vector, Difference difference, std::size_t count>
void together(const std::uint8_t *query, const std::uint8_t *references, std::size_t length,
              std::uint32_t *out) {
    typename Vector::Sums sums[count];
    for (auto &sum : sums)
        sum = Vector::zero();
    std::size_t p = 0;
    for (; p + Vector::bytes <= length; p += Vector::bytes) {
        const typename Vector::Pixels q = Vector::load(query + p);
        for (std::size_t r = 0; r < count; ++r)
            sums[r] = Vector::template add<difference>(sums[r], q,
                                                       Vector::load(references + r * length + p));
    }
    for (std::size_t r = 0; r < count; ++r) {
        std::uint32_t sum = Vector::total(sums[r]);
        for (std::size_t rest = p; rest < length; ++rest)
            sum += pixel_difference<difference>(query[rest], references[r * length + rest]);
        out[r] = sum;
    }
}

template <class Vector, Difference difference>
void row(const std::uint8_t *query, const std::uint8_t *references, std::size_t count,
         std::size_t length, std::uint32_t *out) {
    std::size_t r = 0;
    for (; r + 4 <= count; r += 4)
        together<Vector, difference, 4>(query, references + r * length, length, out + r);
    for (; r < count; ++r)
        together<Vector, difference, 1>(query, references + r * length, length, out + r);
}

template <class Vector>
constexpr ThumbnailKernel rows_of{row<Vector, Difference::absolute>,
                                  row<Vector, Difference::saturating>};

} // namespace
} // namespace retraverse
