// Thumbnail differences for AVX-512.
#include "thumbnails_rows.h"

#include <immintrin.h>

namespace retraverse {

namespace {

struct Avx512 {
    static constexpr std::size_t bytes = 64;
    using Pixels = __m512i;
    using Sums = __m512i;
    static Pixels load(const std::uint8_t *address) { return _mm512_loadu_si512(address); }
    static Sums zero() { return _mm512_setzero_si512(); }
    template <Difference difference> static Sums add(Sums sums, Pixels q, Pixels r) {
        if (difference == Difference::saturating)
            return _mm512_add_epi64(sums, _mm512_sad_epu8(_mm512_subs_epu8(q, r), zero()));
        return _mm512_add_epi64(sums, _mm512_sad_epu8(q, r));
    }
    static std::uint32_t total(Sums sums) {
        std::uint64_t eight[8], sum = 0;
        _mm512_storeu_si512(eight, sums);
        for (std::uint64_t one : eight)
            sum += one;
        return static_cast<std::uint32_t>(sum);
    }
};

} // namespace

const ThumbnailKernel thumbnails_avx512 = rows_of<Avx512>;

} // namespace retraverse
