// What one instruction set offers to regional.cpp. Files compiled for an instruction set include
// this and no C++ library header: an inline function of theirs could be the copy that the linker
// keeps for everybody, and then runs on processors that lack the set.
#pragma once

#include <cstddef>
#include <cstdint>

namespace retraverse {

// How a kernel takes the values of a descriptor, and what one lane's word of them is.
enum class Form {
    floats,           // 1 float; bytes are converted, which is exact
    widened,          // 2 bytes, each as a 16-bit number
    bytes,            // 4 bytes
    signed_reference, // 4 bytes, the reference's less 128: for unsigned-by-signed instructions
};

struct RegionalKernel {
    Form form;
    std::size_t lanes;      // query regions in one vector
    std::size_t width;      // vectors in one panel; the last panel may be narrower
    std::size_t least_rows; // a reference with fewer regions is padded to these
    std::size_t step_block; // more steps than these must be their multiple; 0 = any number may be

    // best[g] = max over the `rows` reference regions of the dot product with query region g.
    // query: packed words, [panel][step][vector of the panel][lane], `vectors` vectors in all;
    // reference: (rows, steps) words; best: vectors * lanes floats (Form::floats) or int32.
    void (*best_matches)(const void *query, std::size_t vectors, const void *reference,
                         std::size_t rows, std::size_t steps, void *best);
    // out[m * stride] = sum over g of weights[m, g] * best[g]; count is a multiple of 16.
    void (*weigh)(const float *best, const float *weights, std::size_t rows, std::size_t count,
                  float *out, std::size_t stride);
    bool (*is_finite)(const float *values, std::size_t count); // null where form is not floats
};

extern const RegionalKernel regional_float32_plain;
extern const RegionalKernel regional_float32_avx2, regional_uint8_avx2;
extern const RegionalKernel regional_float32_avx512, regional_uint8_vnni, regional_uint8_amx;
extern const RegionalKernel regional_float32_neon, regional_uint8_neondot;

// Shared by the byte kernels of the sets above AVX-512 and NEON.
void weigh_avx512(const float *best, const float *weights, std::size_t rows, std::size_t count,
                  float *out, std::size_t stride);


void weigh_neon(const float *best, const float *weights, std::size_t rows, std::size_t count,
                float *out, std::size_t stride);

} // namespace retraverse
