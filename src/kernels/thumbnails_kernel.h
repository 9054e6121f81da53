// What one instruction set offers to thumbnails.cpp: one query against `count` references. Files
// compiled for an instruction set include no C++ library header, see regional_kernel.h.
#pragma once

#include <cstddef>
#include <cstdint>

namespace retraverse {

enum class Difference { absolute, saturating };

using ThumbnailRow = void (*)(const std::uint8_t *query, const std::uint8_t *references,
                              std::size_t count, std::size_t length, std::uint32_t *out);

struct ThumbnailKernel {
    ThumbnailRow absolute, saturating;
};

extern const ThumbnailKernel thumbnails_plain;
extern const ThumbnailKernel thumbnails_avx2, thumbnails_avx512;
extern const ThumbnailKernel thumbnails_neon;

} // namespace retraverse
