"""From a picture to what a network takes: resized, channels first, float32."""

import numpy as np

from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["channels_first", "resized"]


def resized(image: ImageArray, height: int, width: int) -> ImageArray:
    """Return the picture at height x width pixels, its sides stretched as need be.

    Shrinking takes the mean over the area of a pixel, so that no detail folds over into
    coarser patterns; enlarging is bilinear.
    """
    import cv2

    shrinks = image.shape[0] >= height and image.shape[1] >= width
    how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), dtype=np.uint8)


def channels_first(image: Array) -> FloatArray:
    """Return (H, W, C) as contiguous float32 (C, H, W)."""
    return np.ascontiguousarray(image.transpose(2, 0, 1), dtype=np.float32)
