// Thumbnail differences for AVX2.
#include "thumbnails_rows.h"

#include <immintrin.h>

namespace retraverse {

namespace {

struct Avx2 {
    static constexpr std::size_t bytes = 32;
    using Pixels = __m256i;
    using Sums = __m256i;
    static Pixels load(const std::uint8_t *address) {
        return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(address));
    }
    static Sums zero() { return _mm256_setzero_si256(); }
    template <Difference difference> static Sums add(Sums sums, Pixels q, Pixels r) {
        if (difference == Difference::saturating)
            return _mm256_add_epi64(sums, _mm256_sad_epu8(_mm256_subs_epu8(q, r), zero()));
        return _mm256_add_epi64(sums, _mm256_sad_epu8(q, r));
    }
    static std::uint32_t total(Sums sums) {
        const __m128i two =
            _mm_add_epi64(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1));
        return static_cast<std::uint32_t>(_mm_cvtsi128_si64(two) + _mm_extract_epi64(two, 1));
    }
};

} // namespace

const ThumbnailKernel thumbnails_avx2 = rows_of<Avx2>;

} // namespace retraverse
