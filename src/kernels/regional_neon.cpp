#include "regional_tiles.h"

#include <arm_neon.h>

namespace {

struct Float32 {
    using Vector = float32x4_t;
    using Number = float;
    static constexpr int lanes = 4, width = 4, values_per_word = 1;
    // 6 x 4 sums, 4 query vectors and 1 reference word: 29 of 32 registers.
    static constexpr int rows(int width) { return width == 4 ? 6 : 8; }
    static Vector zero() { return vdupq_n_f32(0); }
    static Vector lowest() { return vdupq_n_f32(-__builtin_inff()); }
    static Vector load(const uint32_t *words) { return vreinterpretq_f32_u32(vld1q_u32(words)); }
    static Vector load_floats(const float *values) { return vld1q_f32(values); }
    static Vector spread(const uint32_t *word) {
        return vreinterpretq_f32_u32(vld1q_dup_u32(word));
    }
    static Vector multiply_add(Vector sum, Vector a, Vector b) { return vfmaq_f32(sum, a, b); }
    static Vector larger(Vector a, Vector b) { return vmaxq_f32(a, b); }
    static void store(float *values, Vector a) { vst1q_f32(values, a); }
};

} // namespace

namespace retraverse {

void weigh_neon(const float *best, const float *weights, size_t rows, size_t count, float *out,
                size_t stride) {
    weigh<Float32>(best, weights, rows, count, out, stride);
}

const RegionalKernel regional_float32_neon = {
    Form::floats, Float32::lanes,          Float32::width, 8,
    0,            best_matches<Float32>, weigh_neon, is_finite<Float32>};

} // namespace retraverse
