"""Pictures as the published evaluations of recent networks prepare them.

All take RGB, 0..1, less ImageNet's mean and by its deviation. They differ in the resizing: of the
8-bit picture by Pillow, which rounds and clips, or of floats, which does neither; bilinear or
bicubic; both widen their filter when they shrink.
"""

from typing import Literal

import numpy as np

from retraverse.techniques.preparing.network_input import channels_first
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["Filter", "imagenet_normalised", "resized_8_bit", "resized_float"]

Filter = Literal["bilinear", "bicubic"]

_MEAN = np.array([0.485, 0.456, 0.406], np.float32)
_DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


def imagenet_normalised(image: Array) -> FloatArray:
    """Return float32 (3, H, W) for a picture (H, W, 3), uint8 or float in 0..255."""
    return channels_first((np.asarray(image, np.float32) / 255 - _MEAN) / _DEVIATION)


def resized_8_bit(image: ImageArray, height: int, width: int, how: Filter) -> ImageArray:
    """Return the 8-bit picture (H, W, 3) resized by Pillow."""
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize((width, height), _pillow(how)))


def resized_float(image: ImageArray, height: int, width: int, how: Filter) -> FloatArray:
    """Return the picture resized as float32 in 0..255: bicubic may go a little beyond."""
    from PIL import Image

    planes = [
        Image.fromarray(np.ascontiguousarray(image[:, :, channel], np.float32)).resize(
            (width, height), _pillow(how)
        )
        for channel in range(image.shape[2])
    ]
    return np.stack([np.asarray(plane, np.float32) for plane in planes], axis=2)


def _pillow(how: Filter) -> int:
    from PIL import Image

    return Image.Resampling[how.upper()]
