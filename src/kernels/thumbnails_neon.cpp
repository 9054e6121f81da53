// Thumbnail differences for 64-bit Arm.
#include "thumbnails_rows.h"

#include <arm_neon.h>

namespace retraverse {

namespace {

struct Neon {
    static constexpr std::size_t bytes = 16;
    using Pixels = uint8x16_t;
    using Sums = uint32x4_t;
    static Pixels load(const std::uint8_t *address) { return vld1q_u8(address); }
    static Sums zero() { return vdupq_n_u32(0); }
    template <Difference difference> static Sums add(Sums sums, Pixels q, Pixels r) {
        const uint8x16_t apart =
            difference == Difference::saturating ? vqsubq_u8(q, r) : vabdq_u8(q, r);
        return vpadalq_u16(sums, vpaddlq_u8(apart));
    }
    static std::uint32_t total(Sums sums) { return vaddvq_u32(sums); }
};

} // namespace

const ThumbnailKernel thumbnails_neon = rows_of<Neon>;

} // namespace retraverse
