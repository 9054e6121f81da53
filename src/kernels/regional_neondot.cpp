#include "regional_tiles.h"

#include <arm_neon.h>

namespace {

// Four byte products and their sum in one instruction, both factors unsigned.
struct Bytes {
    using Vector = uint32x4_t;
    using Number = uint32_t;
    static constexpr int lanes = 4, width = 4, values_per_word = 4;
    static constexpr int rows(int width) { return width == 4 ? 6 : 8; }
    static Vector zero() { return vdupq_n_u32(0); }
    static Vector lowest() { return vdupq_n_u32(0); }
    static Vector load(const uint32_t *words) { return vld1q_u32(words); }
    static Vector spread(const uint32_t *word) { return vld1q_dup_u32(word); }
    static Vector multiply_add(Vector sum, Vector a, Vector b) {
        return vdotq_u32(sum, vreinterpretq_u8_u32(a), vreinterpretq_u8_u32(b));
    }
    static Vector larger(Vector a, Vector b) { return vmaxq_u32(a, b); }
    static void store(Number *values, Vector a) { vst1q_u32(values, a); }
};

} // namespace

namespace retraverse {

const RegionalKernel regional_uint8_neondot = {
    Form::bytes, Bytes::lanes, Bytes::width, 8, 0, best_matches<Bytes>, weigh_neon, nullptr};

} // namespace retraverse
