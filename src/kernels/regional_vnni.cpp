#include "regional_tiles.h"

#include <immintrin.h>

namespace {

// Four byte products and their sum in one instruction; its first factor is unsigned, the second
// signed. The reference comes less 128, so every product of query region g lacks the same amount,
// 128 times the region's sum, which regional.cpp adds to the maximum.
struct SignedReference {
    using Vector = __m512i;
    using Number = std::int32_t;
    static constexpr int lanes = 16, width = 4, values_per_word = 4;
    static constexpr int rows(int width) { return width == 4 ? 6 : 8; }
    static Vector zero() { return _mm512_setzero_si512(); }
    static Vector lowest() { return _mm512_set1_epi32(INT32_MIN); }
    static Vector load(const uint32_t *words) { return _mm512_loadu_si512(words); }
    static Vector spread(const uint32_t *word) {
        return _mm512_set1_epi32(static_cast<int>(*word));
    }
    static Vector multiply_add(Vector sum, Vector query, Vector reference) {
        return _mm512_dpbusd_epi32(sum, query, reference);
    }
    static Vector larger(Vector a, Vector b) { return _mm512_mask_max_epi32(a, 0xffff, a, b); }
    static void store(Number *values, Vector a) { _mm512_storeu_si512(values, a); }
};

} // namespace

namespace retraverse {

const RegionalKernel regional_uint8_vnni = {Form::signed_reference,
                                            SignedReference::lanes,
                                            SignedReference::width,
                                            8,
                                            0,
                                            best_matches<SignedReference>,
                                            weigh_avx512,
                                            nullptr};

} // namespace retraverse
