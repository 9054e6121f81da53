// What one instruction set offers to keypoints.cpp. Files compiled for an instruction set include
// no C++ library header, see regional_kernel.h.
#pragma once

#include <cstddef>
#include <cstdint>

namespace retraverse {

// A descriptor of 256 bits is 16 words of 16 bits; a vector holds one word of `lanes` keypoints.
constexpr std::size_t keypoint_bytes = 32, keypoint_words = 16;

// Working memory for one pair of pictures, all aligned to 64 bytes.
struct KeypointScratch {
    std::uint16_t *reference;    // packed: [block][word][lane]
    std::int16_t *out_of_bounds; // [block][lane]: 0, or too far where there is no keypoint
    std::int16_t *best, *who;    // [block][lane]: nearest query keypoint of each reference keypoint
    std::int16_t *nearest;       // [query keypoint]: its nearest reference keypoint, -1 = too far
};

struct KeypointKernel {
    std::size_t lanes;
    // How many of `count` query keypoints and of the references in `blocks` blocks are each
    // other's nearest, at most `max_distance` bits apart. Of equals the lowest index is nearest.
    int (*matches)(const std::uint8_t *query, std::size_t count, std::size_t blocks,
                   int max_distance, const KeypointScratch &scratch);
};

constexpr std::int16_t too_far = 0x3000;

extern const KeypointKernel keypoints_plain, keypoints_avx2, keypoints_avx512;

} // namespace retraverse
