"""Pictures as the techniques of the Caffe years prepare them.

Pictures come as RGB, uint8; networks trained by Caffe take blue, green, red from 0 to 255 less the
mean of their training pictures, unless a technique's program fed them otherwise.
"""

from pathlib import Path
from typing import Literal

import numpy as np

from retraverse.errors import InputError
from retraverse.types import FloatArray, ImageArray
from retraverse.weights.store import find_weights, load_tensors

__all__ = [
    "IMAGENET_MEAN_BGR",
    "MEAN_COLOUR",
    "ChannelOrder",
    "cubic",
    "equalised",
    "find_mean",
    "in_order",
    "read_mean",
    "smooth",
]

ChannelOrder = Literal["rgb", "bgr"]

IMAGENET_MEAN_BGR = (104.0, 117.0, 123.0)
"""Mean colour of ImageNet's pictures, blue first."""
MEAN_COLOUR = "colour"
"""What users say instead of a mean image's name for `IMAGENET_MEAN_BGR`."""


def equalised(image: ImageArray) -> ImageArray:
    """Return a picture whose luminance (Y of YUV) has a flat histogram; colours stay."""
    import cv2

    separated = cv2.cvtColor(image, cv2.COLOR_RGB2YUV)
    separated[:, :, 0] = cv2.equalizeHist(np.ascontiguousarray(separated[:, :, 0]))
    return np.asarray(cv2.cvtColor(separated, cv2.COLOR_YUV2RGB), dtype=np.uint8)


def cubic(image: ImageArray, height: int, width: int) -> ImageArray:
    """Return the picture at height x width by OpenCV's cubic interpolation."""
    import cv2

    return np.asarray(
        cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8
    )


def smooth(image: ImageArray, side: int) -> FloatArray:
    """Return the picture at side x side pixels, bilinear and unrounded, 0 to 255.

    What Caffe's own preparation does: it resizes real numbers.
    """
    import cv2

    return np.asarray(cv2.resize(image.astype(np.float32), (side, side)), dtype=np.float32)


def in_order(image: FloatArray, order: ChannelOrder) -> FloatArray:
    """Return an RGB picture with its channels in the order a network is fed."""
    return image if order == "rgb" else image[:, :, ::-1]


def find_mean(name: str) -> Path | None:
    """Return the file of a mean image by path or name in the store; None for the mean colour.

    Raises
    ------
    DataMissingError
        If it is not there, with what to do.
    """
    return None if name == MEAN_COLOUR else find_weights(name)


def read_mean(path: Path | None, side: int) -> FloatArray:
    """Return a mean image at side x side pixels, (side, side, 3), blue first.

    Parameters
    ----------
    path : Path, optional
        A ``.npy`` or ``.binaryproto`` of shape (3, H, W), blue first; None = the mean colour.
    side : int

    Raises
    ------
    InputError
        If the file holds anything else.
    """
    if path is None:
        return np.broadcast_to(np.array(IMAGENET_MEAN_BGR, np.float32), (side, side, 3))
    arrays = list(load_tensors(path).tensors.values())
    shape = arrays[0].shape[-3:] if arrays else ()
    if len(arrays) != 1 or len(shape) != 3 or shape[0] != 3 or arrays[0].size != np.prod(shape):
        raise InputError(
            f"mean image {path}: got {len(arrays)} arrays, the first of shape {shape}, expected "
            "one of shape (3, height, width)"
        )
    import cv2

    picture = np.ascontiguousarray(arrays[0].reshape(shape).transpose(1, 2, 0), dtype=np.float32)
    return np.asarray(cv2.resize(picture, (side, side)), dtype=np.float32)
