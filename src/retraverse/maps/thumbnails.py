"""Small JPEG pictures of the frames, so that a map can be looked at without its source."""

from dataclasses import dataclass

import numpy as np

from retraverse.errors import ConfigError
from retraverse.types import Array, ImageArray

__all__ = ["ThumbnailSpec", "Thumbnails", "encode_thumbnail"]

SMALLEST, LARGEST = 16, 4096


@dataclass(frozen=True)
class ThumbnailSpec:
    """How thumbnails are made; a map keeps it, so that added frames get the same."""

    max_side: int
    """Longest side in pixels, 16 to 4096; smaller pictures are not enlarged."""
    quality: int = 80
    """JPEG quality, 1 to 100: at 80 a street of 160 x 120 takes about 5 KB."""

    def __post_init__(self) -> None:
        if not SMALLEST <= self.max_side <= LARGEST:
            raise ConfigError(
                f"thumbnails: got a longest side of {self.max_side} pixels, "
                f"expected {SMALLEST} to {LARGEST}"
            )
        if not 1 <= self.quality <= 100:
            raise ConfigError(f"thumbnails: got JPEG quality {self.quality}, expected 1 to 100")


@dataclass(frozen=True)
class Thumbnails:
    """The JPEG files of consecutive frames, end to end."""

    text: Array
    """Uint8 (bytes,): one file after the other."""
    ends: Array
    """Int64 (N,): where each one stops."""


def encode_thumbnail(colour: ImageArray, spec: ThumbnailSpec) -> bytes:
    """Return a picture as a small JPEG file.

    Parameters
    ----------
    colour : uint8 array, shape (height, width, 3), RGB
    spec : ThumbnailSpec
    """
    import cv2

    height, width = colour.shape[:2]
    scale = spec.max_side / max(height, width)
    if scale < 1:
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        colour = cv2.resize(colour, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    bgr = np.ascontiguousarray(colour[..., ::-1])
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, spec.quality])
    return bytes(encoded)
