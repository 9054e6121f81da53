// Mutual nearest keypoints for any processor: vectors as the compiler knows them.
#include "keypoints_lanes.h"

namespace retraverse {

const KeypointKernel keypoints_plain = {Lanes<16>::count, Lanes<16>::matches};

} // namespace retraverse
