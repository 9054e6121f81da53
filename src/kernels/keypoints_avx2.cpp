// Mutual nearest keypoints for AVX2.
#include "keypoints_lanes.h"

namespace retraverse {

const KeypointKernel keypoints_avx2 = {Lanes<32>::count, Lanes<32>::matches};

} // namespace retraverse
