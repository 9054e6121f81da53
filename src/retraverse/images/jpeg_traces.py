"""How much JPEG took out of a picture, seen in its pixels alone.

JPEG works on blocks of 8 x 8 pixels and sets their small frequencies to zero, the more the
stronger it compresses. Pixels that came out of a JPEG file keep the traces: on the file's own grid
far more frequencies are silent than on a grid moved by half a block. A picture that was resized
afterwards has lost the grid, and shows none.

References
----------
Fan, de Queiroz: Identification of Bitmap Compression History: JPEG Detection and Quantizer
Estimation, IEEE Transactions on Image Processing, 2003: traces on the grid and off it.
"""

from functools import lru_cache

import numpy as np

from retraverse.images.decode import check_array, to_grey
from retraverse.types import FloatArray, ImageArray

__all__ = ["STRONG_TRACES", "jpeg_traces"]

STRONG_TRACES = 0.45
"""Above this a picture was compressed strongly. Of 35 photographs at three sizes all at c = 95
and more have such traces, 19 of 20 at c = 90, half at c = 75, one in twelve at c = 50 and none
that was not compressed (``benchmarks/jpeg_traces.py``)."""

_BLOCK = 8
_HALF = _BLOCK // 2
_FREQUENCIES = 5
"""Of the eight in each direction, the lowest: high ones are silent in most pictures anyway."""
_SILENT = 1.5
"""Grey levels; rounding to whole pixels leaves up to about one of a silent frequency."""
_MOST_BLOCKS = 4096
"""Of a large picture every so many rows of blocks are looked at, no more than this in all."""


def jpeg_traces(picture: ImageArray) -> float:
    """Return the share of a picture's low frequencies that JPEG has silenced.

    Parameters
    ----------
    picture : uint8 array, shape (height, width) or (height, width, 3) RGB
        As decoded: cropped at most at the right or below, not resized.

    Returns
    -------
    share : float
        0 to 1; about 0 for pictures that were not compressed, or too small to tell (under 24
        pixels a side).

    Raises
    ------
    ShapeError
        If the array is no picture.
    """
    luma = to_grey(check_array(picture), "rgb").astype(np.float32)
    if min(luma.shape) < 3 * _BLOCK:
        return 0.0
    off_grid = _silent_share(luma[_HALF:, _HALF:])
    return max(0.0, (_silent_share(luma) - off_grid) / max(1 - off_grid, 1e-6))


def _silent_share(luma: FloatArray) -> float:
    """Return the share of the low frequencies of all blocks that are about zero."""
    rows, columns = luma.shape[0] // _BLOCK, luma.shape[1] // _BLOCK
    step = -(-rows * columns // _MOST_BLOCKS)
    whole = luma[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
    blocks = whole[::step].transpose(0, 2, 1, 3)
    basis = _cosines()
    frequencies = (basis @ blocks @ basis.T).reshape(-1, _FREQUENCIES**2)[:, _low()]
    return float((np.abs(frequencies) < _SILENT).mean())


@lru_cache(maxsize=1)
def _cosines() -> FloatArray:
    """Return the first rows of the orthonormal cosine transform, shape (5, 8)."""
    place = np.arange(_BLOCK)
    basis = np.cos((2 * place + 1) * np.arange(_FREQUENCIES)[:, None] * np.pi / (2 * _BLOCK))
    basis *= np.sqrt(2 / _BLOCK)
    basis[0] /= np.sqrt(2)
    return basis.astype(np.float32)


@lru_cache(maxsize=1)
def _low() -> np.ndarray:
    """Return which of the 25 are looked at: those below the diagonal, without the mean."""
    order = np.add.outer(np.arange(_FREQUENCIES), np.arange(_FREQUENCIES)).ravel()
    return np.flatnonzero((order > 0) & (order < _FREQUENCIES))
