"""What JPEG does to a picture, one part at a time: frequencies, steps, grid, colour.

For finding out which part of the damage a technique suffers from. Nothing here is a codec: no bytes
come out, only pictures with one part of the damage done.

Conventions
- Pictures are uint8 (height, width) grey or (height, width, 3) RGB; results have their shape.
- Colour is full-range YCbCr as in JPEG files; blocks are 8 x 8 from the upper left corner, and
  pictures are padded by their edges to whole blocks.
- *Bands* of a block: coefficients with u + v < n, so band 1 is the block's mean, n (n + 1) / 2
  coefficients in all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from types import MappingProxyType
from typing import cast

import numpy as np

from retraverse.errors import ConfigError
from retraverse.images.decode import decode_native, to_rgb
from retraverse.images.jpeg import Encoder, encode_jpeg
from retraverse.images.quantisation import STANDARD_TABLES, QuantisationTables
from retraverse.types import Array, BoolArray, FloatArray, ImageArray

__all__ = [
    "JPEG_PARTS",
    "JpegPart",
    "compress",
    "deblock",
    "grid_only",
    "keep_bands",
    "keep_bands_smoothly",
    "mix_planes",
    "quantise",
    "subsample_colour",
    "without_colour",
]

SIDE = 8
# Along the diagonal each row and column of a block is an edge as often as with all pairs.
_DEBLOCKING_SHIFTS = (0, 2, 4, 6)


def compress(picture: ImageArray, compression: int, encoder: Encoder | None = None) -> ImageArray:
    """Return the picture as it comes out of a JPEG file of this c: all parts at once."""
    decoded = decode_native(encode_jpeg(picture, compression, encoder))
    return decoded if decoded.ndim == 2 else to_rgb(decoded, "bgr")


def keep_bands(picture: ImageArray, n_bands: int) -> ImageArray:
    """Return the picture with only the lowest bands of every block, unquantised.

    Parameters
    ----------
    n_bands : int in [1, 15]
        1 leaves the blocks' means, 15 everything.
    """
    mask = _band_mask(_checked_bands(n_bands))
    return _by_plane(picture, lambda plane, _: _on_blocks(plane, lambda block: block * mask))


def keep_bands_smoothly(picture: ImageArray, n_bands: int) -> ImageArray:
    """Return the picture low-passed as a whole: as many coefficients as `keep_bands`, no grid.

    The difference between the two is what the blocks' edges do.
    """
    bands = _checked_bands(n_bands)
    # A triangle of side t holds t^2 / 2 of the 64 frequency cells.
    side = float(np.sqrt(bands * (bands + 1))) if bands < 2 * SIDE - 1 else 2.0 * SIDE
    return _by_plane(picture, lambda plane, _: _low_pass(plane, side))


def quantise(
    picture: ImageArray,
    compression: int,
    *,
    means: bool = True,
    details: bool = True,
    tables: QuantisationTables = STANDARD_TABLES,
) -> ImageArray:
    """Return the picture with its blocks' coefficients rounded to the steps of this c.

    Parameters
    ----------
    means : bool
        Round the blocks' means.
    details : bool
        Round everything else. Both together are JPEG without colour subsampling.
    """
    luminance, chrominance = (
        np.array(table, np.float32).reshape(SIDE, SIDE)
        for table in tables.at_quality(100 - compression)
    )
    mean = _band_mask(1).astype(bool)
    chosen = (mean & means) | (~mean & details)

    def round_plane(plane: FloatArray, number: int) -> FloatArray:
        steps = luminance if number == 0 else chrominance
        return _on_blocks(plane, lambda block: _rounded(block, steps, chosen))

    return _by_plane(picture, round_plane)


def subsample_colour(picture: ImageArray) -> ImageArray:
    """Return the picture with its colour planes at half the size and back; grey as it is."""
    import cv2

    def halve(plane: FloatArray, number: int) -> FloatArray:
        if number == 0:
            return plane
        height, width = plane.shape
        small = cv2.resize(
            plane, ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA
        )
        return cast(FloatArray, cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))

    return _by_plane(picture, halve)


def without_colour(picture: ImageArray) -> ImageArray:
    """Return the picture with neutral colour planes: its luminance only, still three channels."""
    return _by_plane(picture, lambda plane, number: plane if number == 0 else np.zeros_like(plane))


def mix_planes(luminance_of: ImageArray, colour_of: ImageArray) -> ImageArray:
    """Return a picture with the luminance of one and the colour of another of the same shape."""
    if luminance_of.ndim == 2:
        return luminance_of.copy()
    planes = [_planes(luminance_of)[0], *_planes(colour_of)[1:]]
    return _from_planes(planes)


def deblock(picture: ImageArray, compression: int) -> ImageArray:
    """Return the JPEG picture of this c with its block grid smoothed away.

    The mean of four pictures, each compressed once more on a grid shifted along the diagonal:
    every pixel is then near a block's edge in one and far from it in others, while what a block
    can hold stays.

    References
    ----------
    Nosratinia: Enhancement of JPEG-compressed images by re-application of JPEG, Journal of VLSI
    Signal Processing 27, 2001, section 3.
    """
    once = compress(picture, compression)
    height, width = once.shape[:2]
    edges: list[tuple[int, int]] = [(0, SIDE), (0, SIDE)] + [(0, 0)] * (once.ndim - 2)
    total = np.zeros(once.shape, np.float64)
    for shift in _DEBLOCKING_SHIFTS:
        edges[:2] = [(shift, SIDE - shift)] * 2
        shifted = compress(np.pad(once, edges, mode="edge"), compression)
        total += shifted[shift : shift + height, shift : shift + width]
    return _to_pixels(total / len(_DEBLOCKING_SHIFTS))


def grid_only(picture: ImageArray, compression: int) -> ImageArray:
    """Return the clean picture with nothing added but the block grid of its JPEG of this c.

    The grid is what `deblock` takes away.
    """
    grid = compress(picture, compression).astype(np.float64) - deblock(picture, compression)
    return _to_pixels(picture + grid)


def _checked_bands(n_bands: int) -> int:
    if not 1 <= n_bands <= 2 * SIDE - 1:
        raise ConfigError(f"bands: got {n_bands}, expected 1 to {2 * SIDE - 1}")
    return n_bands


@lru_cache
def _cosines() -> FloatArray:
    """Return the orthonormal 8-point cosine transform, rows are frequencies (T.81, A.3.3)."""
    u, x = np.mgrid[0:SIDE, 0:SIDE]
    rows = np.sqrt(2 / SIDE) * np.cos((2 * x + 1) * u * np.pi / (2 * SIDE))
    rows[0] /= np.sqrt(2)
    return np.asarray(rows, np.float32)


@lru_cache
def _band_mask(n_bands: int) -> FloatArray:
    v, u = np.mgrid[0:SIDE, 0:SIDE]
    return np.asarray(u + v < n_bands, np.float32)


def _rounded(block: FloatArray, steps: FloatArray, chosen: BoolArray) -> FloatArray:
    return np.asarray(np.where(chosen, np.round(block / steps) * steps, block), np.float32)


def _on_blocks(plane: FloatArray, change: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return a plane (around 0) whose blocks' coefficients, (rows, columns, 8, 8), were changed."""
    height, width = plane.shape
    padded = np.pad(plane, ((0, -height % SIDE), (0, -width % SIDE)), mode="edge")
    shape = (padded.shape[0] // SIDE, SIDE, padded.shape[1] // SIDE, SIDE)
    blocks = padded.reshape(shape).swapaxes(1, 2)
    cosines = _cosines()
    changed = change(cosines @ blocks @ cosines.T)
    back = (cosines.T @ changed @ cosines).swapaxes(1, 2).reshape(padded.shape)
    return np.asarray(back[:height, :width], np.float32)


def _low_pass(plane: FloatArray, side: float) -> FloatArray:
    """Keep the frequencies below a diagonal; `side` counts in eighths of the finest frequency."""
    import cv2

    height, width = plane.shape
    # OpenCV transforms even sizes only.
    padded = np.pad(plane, ((0, -height % SIDE), (0, -width % SIDE)), mode="edge")
    v, u = np.mgrid[0 : padded.shape[0], 0 : padded.shape[1]]
    kept = SIDE * (v / padded.shape[0] + u / padded.shape[1]) < side
    back = cv2.idct(cv2.dct(padded) * kept.astype(np.float32))
    return np.asarray(back[:height, :width], np.float32)


def _by_plane(picture: ImageArray, change: Callable[[FloatArray, int], FloatArray]) -> ImageArray:
    """Return the picture with each plane (around 0, with its number) changed."""
    planes = [change(plane, number) for number, plane in enumerate(_planes(picture))]
    return _from_planes(planes)


def _planes(picture: ImageArray) -> list[FloatArray]:
    """Return luminance, or luminance and the two colour planes, as float32 around 0."""
    values = picture.astype(np.float32)
    if picture.ndim == 2:
        return [values - 128]
    red, green, blue = np.moveaxis(values, 2, 0)
    luminance = 0.299 * red + 0.587 * green + 0.114 * blue
    planes = [luminance - 128, (blue - luminance) / 1.772, (red - luminance) / 1.402]
    return [np.asarray(plane, np.float32) for plane in planes]


def _from_planes(planes: list[FloatArray]) -> ImageArray:
    if len(planes) == 1:
        return _to_pixels(planes[0] + 128)
    luminance, to_blue, to_red = planes[0] + 128, planes[1], planes[2]
    red, blue = luminance + 1.402 * to_red, luminance + 1.772 * to_blue
    green = (luminance - 0.299 * red - 0.114 * blue) / 0.587
    return _to_pixels(np.dstack([red, green, blue]))


def _to_pixels(values: Array) -> ImageArray:
    return np.asarray(np.clip(np.round(values), 0, 255), np.uint8)


@dataclass(frozen=True)
class JpegPart:
    """One part of what JPEG does."""

    name: str
    summary: str
    """One clause: what is done and what is left alone."""
    apply: Callable[[ImageArray, int], ImageArray]
    """(picture, c) -> picture; parts without quantisation do not look at c."""


def _only_luminance(picture: ImageArray, c: int) -> ImageArray:
    return mix_planes(compress(picture, c), picture)


def _only_colour(picture: ImageArray, c: int) -> ImageArray:
    return mix_planes(picture, compress(picture, c))


def _in_blocks(picture: ImageArray, _: int, *, n_bands: int) -> ImageArray:
    return keep_bands(picture, n_bands)


def _smooth(picture: ImageArray, _: int, *, n_bands: int) -> ImageArray:
    return keep_bands_smoothly(picture, n_bands)


def _band_parts(n: int) -> tuple[JpegPart, JpegPart]:
    """Return a block's lowest bands, and the same frequencies of the whole picture."""
    share = f"{n * (n + 1) // 2} of 64"
    return (
        JpegPart(
            f"{n} bands in blocks",
            f"{share} coefficients a block, unrounded",
            partial(_in_blocks, n_bands=n),
        ),
        JpegPart(
            f"{n} bands smooth",
            f"as many of the whole picture's coefficients, no grid ({share})",
            partial(_smooth, n_bands=n),
        ),
    )


_parts = (
    JpegPart("luminance", "JPEG's luminance with clean colour", _only_luminance),
    JpegPart("colour", "clean luminance with JPEG's colour", _only_colour),
    JpegPart("subsampled", "colour at half the size, else clean", lambda p, _: subsample_colour(p)),
    JpegPart("no colour", "luminance only, else clean", lambda p, _: without_colour(p)),
    JpegPart("means", "the blocks' means rounded", partial(quantise, details=False)),
    JpegPart("details", "all but the means rounded", partial(quantise, means=False)),
    JpegPart("deblocked", "JPEG with its grid smoothed away", deblock),
    JpegPart("grid", "the clean picture with JPEG's grid added", grid_only),
    *(part for n in (1, 2, 4) for part in _band_parts(n)),
)
JPEG_PARTS: Mapping[str, JpegPart] = MappingProxyType({part.name: part for part in _parts})
"""Name -> part, in the order of tables."""
