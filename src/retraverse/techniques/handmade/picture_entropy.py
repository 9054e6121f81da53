"""The entropy of a whole picture, for techniques whose descriptions do not hold it."""

import numpy as np

from retraverse import kernels
from retraverse.techniques.handmade.regional_hog import ENTROPY_RADIUS, ENTROPY_SIDE
from retraverse.types import ImageArray

__all__ = ["picture_entropy"]

PICTURE_SIDE = 512
"""Pictures are brought to this size first, as regional HOG does: the two values are then one."""


def picture_entropy(grey: ImageArray) -> float:
    """Return the mean local entropy of a grey picture, in [0, 0.7925] (equation 3.5).

    Parameters
    ----------
    grey : uint8 array, shape (H, W)

    Notes
    -----
    Local entropy over disks of radius 5 in a picture of 100 x 100, divided by the 8 bits of a
    pixel; equal to what ``convsequential`` stores of the same grey picture.

    References
    ----------
    ConvSequential-SLAM thesis, sections 3.2.2 and 3.2.6.
    """
    import cv2

    square = cv2.resize(grey, (PICTURE_SIDE, PICTURE_SIDE))
    small = np.asarray(cv2.resize(square, (ENTROPY_SIDE, ENTROPY_SIDE)), dtype=np.uint8)
    entropy_map = kernels.local_entropy(small, radius=ENTROPY_RADIUS)
    return kernels.region_entropies(entropy_map, size=PICTURE_SIDE)[1]
