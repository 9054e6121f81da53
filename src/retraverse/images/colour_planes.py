"""Pictures as the planes that video codecs take: full-range Y, Cb, Cr, colour at half the size.

JPEG's own planes at 4:2:0. Sides are made even, and no smaller than the smallest an encoder takes,
by repeating the last row and column; what was added is cut off again.
"""

from typing import cast

import numpy as np

from retraverse.types import ImageArray

__all__ = ["Planes", "coded_size", "from_planes", "to_planes"]

Planes = tuple[ImageArray, ImageArray, ImageArray]
"""Y, Cb, Cr."""

_SMALLEST_SIDE = 64
"""SVT-AV1's."""


def coded_size(height: int, width: int) -> tuple[int, int]:
    """Return the height and width that are encoded for a picture."""
    padded = [max(_SMALLEST_SIDE, side + side % 2) for side in (height, width)]
    return padded[0], padded[1]


def to_planes(picture: ImageArray) -> Planes:
    """Return the planes of a grey or RGB picture; each colour value is the mean of four."""
    import cv2

    coded_height, coded_width = coded_size(*picture.shape[:2])
    below, right = coded_height - picture.shape[0], coded_width - picture.shape[1]
    padded = cv2.copyMakeBorder(picture, 0, below, 0, right, cv2.BORDER_REPLICATE)
    half = (coded_width // 2, coded_height // 2)
    if picture.ndim == 2:
        neutral = np.full(half[::-1], 128, np.uint8)
        return cast(Planes, (padded, neutral, neutral))
    luma, red, blue = cv2.split(cv2.cvtColor(padded, cv2.COLOR_RGB2YCrCb))
    small = [cv2.resize(plane, half, interpolation=cv2.INTER_AREA) for plane in (blue, red)]
    return cast(Planes, (luma, *small))


def from_planes(planes: Planes, height: int, width: int, *, grey: bool) -> ImageArray:
    """Return the picture of some planes: uint8 (height, width), or (height, width, 3) RGB."""
    import cv2

    luma, blue, red = planes
    if grey:
        return np.ascontiguousarray(luma[:height, :width])
    size = luma.shape[::-1]
    full = [cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR) for plane in (red, blue)]
    rgb = cv2.cvtColor(cv2.merge([luma, *full]), cv2.COLOR_YCrCb2RGB)
    return np.ascontiguousarray(rgb[:height, :width], np.uint8)
