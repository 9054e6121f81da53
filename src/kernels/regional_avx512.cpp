#include "regional_tiles.h"

#include <immintrin.h>

namespace {

struct Float32 {
    using Vector = __m512;
    using Number = float;
    static constexpr int lanes = 16, width = 4, values_per_word = 1;
    // 6 x 4 sums, 4 query vectors and 1 reference word: 29 of 32 registers.
    static constexpr int rows(int width) { return width == 4 ? 6 : 8; }
    static Vector zero() { return _mm512_setzero_ps(); }
    static Vector lowest() { return _mm512_set1_ps(-__builtin_inff()); }
    static Vector load(const uint32_t *words) { return _mm512_loadu_ps(words); }
    static Vector load_floats(const float *values) { return _mm512_loadu_ps(values); }
    static Vector spread(const uint32_t *word) {
        return _mm512_set1_ps(*reinterpret_cast<const float *>(word));
    }
    static Vector multiply_add(Vector sum, Vector a, Vector b) {
        return _mm512_fmadd_ps(a, b, sum);
    }
    static Vector larger(Vector a, Vector b) { return _mm512_mask_max_ps(a, 0xffff, a, b); }
    static void store(float *values, Vector a) { _mm512_storeu_ps(values, a); }
};

} // namespace

namespace retraverse {

void weigh_avx512(const float *best, const float *weights, size_t rows, size_t count, float *out,
                  size_t stride) {
    weigh<Float32>(best, weights, rows, count, out, stride);
}

const RegionalKernel regional_float32_avx512 = {
    Form::floats, Float32::lanes,          Float32::width, 8,
    0,            best_matches<Float32>, weigh_avx512,   is_finite<Float32>};

} // namespace retraverse
