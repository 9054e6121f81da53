// The register-blocked loops that every vector instruction set shares, over a `Simd` that names its
// vectors and its five operations. All in an unnamed namespace: see regional_kernel.h.
#pragma once

#include "regional_kernel.h"

#if defined(__clang__)
#define UNROLLED _Pragma("clang loop unroll(full)")
#else
#define UNROLLED _Pragma("GCC unroll 64")
#endif

namespace {

using std::size_t;
using std::uint32_t;

// Multiply `Rows` reference regions with `Width` vectors of query regions and keep the maxima.
// `Steps` is the descriptor's length in words, or 0 where it is known only at run time.
template <class Simd, int Width, int Rows, int Steps>
inline __attribute__((always_inline)) void tile(const uint32_t *query, const uint32_t *reference,
                                                size_t run_time_steps,
                                                typename Simd::Vector (&best)[Width]) {
    const size_t steps = Steps ? Steps : run_time_steps;
    // Every tile of a panel loads the same query: without this the compiler loads all of it before
    // the first tile, into more registers than there are.
    __asm__ volatile("" : "+r"(query));
    typename Simd::Vector sums[Rows][Width];
    UNROLLED for (int row = 0; row < Rows; ++row)
        UNROLLED for (int v = 0; v < Width; ++v) sums[row][v] = Simd::zero();
    const auto step = [&](size_t s) __attribute__((always_inline)) {
        typename Simd::Vector across[Width];
        UNROLLED for (int v = 0; v < Width; ++v)
            across[v] = Simd::load(query + (s * Width + v) * Simd::lanes);
        UNROLLED for (int row = 0; row < Rows; ++row) {
            const auto spread = Simd::spread(reference + row * steps + s);
            UNROLLED for (int v = 0; v < Width; ++v)
                sums[row][v] = Simd::multiply_add(sums[row][v], across[v], spread);
        }
    };
    if constexpr (Steps != 0) {
        UNROLLED for (int s = 0; s < Steps; ++s) step(s);
    } else {
        for (size_t s = 0; s < steps; ++s)
            step(s);
    }
    UNROLLED for (int row = 0; row < Rows; ++row)
        UNROLLED for (int v = 0; v < Width; ++v) best[v] = Simd::larger(best[v], sums[row][v]);
}

// All reference regions against one panel of the query. The last tile starts early instead of being
// narrower: a region seen twice does not change a maximum.
template <class Simd, int Width, int Steps>
void panel(const uint32_t *query, const uint32_t *reference, size_t rows, size_t steps,
           typename Simd::Number *best_out) {
    constexpr int Rows = Simd::rows(Width);
    typename Simd::Vector best[Width];
    UNROLLED for (int v = 0; v < Width; ++v) best[v] = Simd::lowest();
    for (size_t row = 0; row < rows; row += Rows) {
        const size_t first = row + Rows <= rows ? row : rows - Rows;
        tile<Simd, Width, Rows, Steps>(query, reference + first * steps, steps, best);
    }
    UNROLLED for (int v = 0; v < Width; ++v) Simd::store(best_out + v * Simd::lanes, best[v]);
}

template <class Simd, int Width, int Steps>
void panels(const uint32_t *query, size_t vectors, const uint32_t *reference, size_t rows,
            size_t steps, typename Simd::Number *best) {
    for (; vectors >= Width; vectors -= Width) {
        panel<Simd, Width, Steps>(query, reference, rows, steps, best);
        query += Width * Simd::lanes * steps;
        best += Width * Simd::lanes;
    }
    if constexpr (Width > 1)
        if (vectors > 0)
            panels<Simd, Width - 1, Steps>(query, vectors, reference, rows, steps, best);
}

// Descriptors of regional HOG have 4 cells x 8 bins = 32 values: their loop is unrolled in full.
template <class Simd>
void best_matches(const void *query, size_t vectors, const void *reference, size_t rows,
                  size_t steps, void *best) {
    constexpr int usual = 32 / Simd::values_per_word;
    const auto run =
        steps == usual ? panels<Simd, Simd::width, usual> : panels<Simd, Simd::width, 0>;
    run(static_cast<const uint32_t *>(query), vectors, static_cast<const uint32_t *>(reference),
        rows, steps, static_cast<typename Simd::Number *>(best));
}

// Sixteen partial sums whatever the register's width, so that every set adds in the same order.
template <class Simd>
void weigh(const float *best, const float *weights, size_t rows, size_t count, float *out,
           size_t stride) {
    constexpr int parts = 16 / Simd::lanes;
    for (size_t m = 0; m < rows; ++m, weights += count) {
        typename Simd::Vector sums[parts];
        UNROLLED for (int p = 0; p < parts; ++p) sums[p] = Simd::zero();
        for (size_t g = 0; g < count; g += 16)
            UNROLLED for (int p = 0; p < parts; ++p)
                sums[p] = Simd::multiply_add(sums[p], Simd::load_floats(best + g + p * Simd::lanes),
                                             Simd::load_floats(weights + g + p * Simd::lanes));
        float total[16];
        UNROLLED for (int p = 0; p < parts; ++p) Simd::store(total + p * Simd::lanes, sums[p]);
        for (int half = 8; half > 0; half /= 2)
            for (int i = 0; i < half; ++i)
                total[i] += total[i + half];
        out[m * stride] = total[0];
    }
}

// NaN and infinity times 0 are NaN, and NaN stays in a sum.
template <class Simd> bool is_finite(const float *values, size_t count) {
    constexpr int parts = 4;
    typename Simd::Vector sums[parts];
    UNROLLED for (int p = 0; p < parts; ++p) sums[p] = Simd::zero();
    size_t i = 0;
    for (; i + parts * Simd::lanes <= count; i += parts * Simd::lanes)
        UNROLLED for (int p = 0; p < parts; ++p)
            sums[p] = Simd::multiply_add(sums[p], Simd::load_floats(values + i + p * Simd::lanes),
                                         Simd::zero());
    float total[parts * Simd::lanes];
    UNROLLED for (int p = 0; p < parts; ++p) Simd::store(total + p * Simd::lanes, sums[p]);
    float sum = 0;
    for (float part : total)
        sum += part;
    for (; i < count; ++i)
        sum += values[i] * 0.0f;
    return sum == 0;
}

} // namespace
