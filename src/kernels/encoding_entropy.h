// Local entropy over a disk, by a histogram that slides along each row.
#pragma once

#include <cstdint>

namespace retraverse {

// image: height x width; entropy: the same, in bits; radius in 1..100.
void local_entropy(const std::uint8_t *image, int height, int width, int radius, double *entropy);

} // namespace retraverse
