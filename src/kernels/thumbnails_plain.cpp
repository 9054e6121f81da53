// Thumbnail differences without vector instructions of our own; compilers find some.
#include "thumbnails_rows.h"

namespace retraverse {

namespace {

struct Plain {
    static constexpr std::size_t bytes = 1;
    using Pixels = std::uint8_t;
    using Sums = std::uint32_t;
    static Pixels load(const std::uint8_t *address) { return *address; }
    static Sums zero() { return 0; }
    template <Difference difference> static Sums add(Sums sums, Pixels q, Pixels r) {
        return sums + pixel_difference<difference>(q, r);
    }
    static std::uint32_t total(Sums sums) { return sums; }
};

} // namespace

const ThumbnailKernel thumbnails_plain = rows_of<Plain>;

} // namespace retraverse
