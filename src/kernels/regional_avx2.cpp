#include "regional_tiles.h"

#include <immintrin.h>

namespace {

struct Float32 {
    using Vector = __m256;
    using Number = float;
    static constexpr int lanes = 8, width = 2, values_per_word = 1;
    // 6 x 2 sums, 2 query vectors and 1 reference word: 15 of 16 registers.
    static constexpr int rows(int width) { return width == 2 ? 6 : 8; }
    static Vector zero() { return _mm256_setzero_ps(); }
    static Vector lowest() { return _mm256_set1_ps(-__builtin_inff()); }
    static Vector load(const uint32_t *words) {
        return _mm256_loadu_ps(reinterpret_cast<const float *>(words));
    }
    static Vector load_floats(const float *values) { return _mm256_loadu_ps(values); }
    static Vector spread(const uint32_t *word) {
        return _mm256_broadcast_ss(reinterpret_cast<const float *>(word));
    }
    static Vector multiply_add(Vector sum, Vector a, Vector b) {
        return _mm256_fmadd_ps(a, b, sum);
    }
    static Vector larger(Vector a, Vector b) { return _mm256_max_ps(a, b); }
    static void store(float *values, Vector a) { _mm256_storeu_ps(values, a); }
};

// Bytes widened to 16 bits: the one instruction that multiplies bytes here saturates.
struct Widened {
    using Vector = __m256i;
    using Number = std::int32_t;
    static constexpr int lanes = 8, width = 2, values_per_word = 2;
    static constexpr int rows(int) { return 6; }
    static Vector zero() { return _mm256_setzero_si256(); }
    static Vector lowest() { return _mm256_setzero_si256(); }
    static Vector load(const uint32_t *words) {
        return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(words));
    }
    static Vector spread(const uint32_t *word) {
        return _mm256_set1_epi32(static_cast<int>(*word));
    }
    static Vector multiply_add(Vector sum, Vector a, Vector b) {
        sum = _mm256_add_epi32(sum, _mm256_madd_epi16(a, b));
        // Integer sums may be reordered, and the compiler's order needs more registers than exist.
        __asm__("" : "+x"(sum));
        return sum;
    }
    static Vector larger(Vector a, Vector b) { return _mm256_max_epi32(a, b); }
    static void store(Number *values, Vector a) {
        _mm256_storeu_si256(reinterpret_cast<__m256i *>(values), a);
    }
};

} // namespace

namespace retraverse {

const RegionalKernel regional_float32_avx2 = {
    Form::floats, Float32::lanes,          Float32::width, 8,
    0,            best_matches<Float32>, weigh<Float32>, is_finite<Float32>};
const RegionalKernel regional_uint8_avx2 = {
    Form::widened, Widened::lanes,          Widened::width, 8,
    0,             best_matches<Widened>, weigh<Float32>, nullptr};

} // namespace retraverse
