"""Decoded pictures, resized, each made once for all compressions of it."""

import threading

import numpy as np

from retraverse.images.decode import check_array, decode_native, to_rgb
from retraverse.images.pixels import ArrayPixels, Pixels
from retraverse.images.worsening import Resizer, Worsening
from retraverse.types import ImageArray

__all__ = ["PictureCache", "native_pixels", "resize_square", "resized_pixels"]


class PictureCache:
    """Decoded (and resized) pictures of the last frames asked for, up to so many bytes.

    Give one cache to all compressions of a drive and each picture is decoded once. A file that
    changes meanwhile is not noticed, so make a new cache for a new run. Thread-safe.

    Parameters
    ----------
    max_bytes : int
        Of pixels; the oldest go first. One picture is kept whatever its size.
    """

    def __init__(self, max_bytes: int = 64 * 2**20) -> None:
        self.max_bytes = max_bytes
        self.n_decoded = 0
        """How many pictures were not found here and had to be made."""
        self._lock = threading.Lock()
        # Keyed by identity; the pixel source is kept too, so that its id cannot be given away.
        self._kept: dict[tuple[int, int | None, str], tuple[Pixels, ImageArray]] = {}
        self._n_bytes = 0

    def pixels(self, source: Pixels, worsening: Worsening) -> ImageArray:
        """Return the resized pixels of a source, shared: not to be written to."""
        key = (id(source), worsening.resize, worsening.resizer if worsening.resize else "")
        with self._lock:
            kept = self._kept.pop(key, None)
            if kept is not None:
                self._kept[key] = kept  # now the youngest
                return kept[1]
        picture = resized_pixels(source, worsening)
        with self._lock:
            self.n_decoded += 1
            if key not in self._kept:
                self._kept[key] = (source, picture)
                self._n_bytes += picture.nbytes
            while len(self._kept) > 1 and self._n_bytes > self.max_bytes:
                self._n_bytes -= self._kept.pop(next(iter(self._kept)))[1].nbytes
        return picture


def native_pixels(source: Pixels) -> ImageArray:
    """Return the pixels as the source has them: (height, width) if grey, else RGB.

    Raises
    ------
    FrameReadError
        If they cannot be read; the reason without the name.
    """
    encoded = source.encoded()
    if encoded is not None:
        native = decode_native(encoded)
        return native if native.ndim == 2 else to_rgb(native, "bgr")
    if isinstance(source, ArrayPixels):
        picture = check_array(source.items[source.position])
        return picture if picture.ndim == 2 else to_rgb(picture, source.colour_order)
    return source.rgb()


def resize_square(picture: ImageArray, side: int, resizer: Resizer) -> ImageArray:
    """Return a grey or RGB picture as a square, by the library's default filter."""
    if resizer == "opencv":
        import cv2

        return np.asarray(cv2.resize(picture, (side, side)), np.uint8)
    from PIL import Image

    return np.asarray(Image.fromarray(picture).resize((side, side)))


def resized_pixels(source: Pixels, worsening: Worsening) -> ImageArray:
    """Return the pixels of a source at the size asked for, as OpenCV decodes them."""
    picture = native_pixels(source)
    if worsening.resize is None:
        return picture
    return resize_square(picture, worsening.resize, worsening.resizer)
