// Mutual nearest keypoints for AVX-512.
#include "keypoints_lanes.h"

namespace retraverse {

const KeypointKernel keypoints_avx512 = {Lanes<64>::count, Lanes<64>::matches};

} // namespace retraverse
