"""Local contrast enhancement: how a difference stands out among those of neighbouring references.

Source: Milford and Wyeth, ICRA 2012, section III.B, equation 2; as their published program does
it, windows are cut off at the ends of the map and the deviation divides by one less than their
size.
"""

import numpy as np

from retraverse.types import Array, FloatArray

__all__ = ["enhance_contrast"]

BLOCK_ROWS = 16
"""Rows at a time: few enough to stay in the processor's cache."""
FLAT = 1e-10
"""A window whose variance is below this, relative to its row's largest square, is constant up to
rounding: nothing in it stands out."""


def enhance_contrast(differences: FloatArray, radius: int) -> FloatArray:
    """Return (D - mean) / deviation over each pair's window of references.

    Parameters
    ----------
    differences : float32 array, shape (Q, R)
        Rows are queries, columns references; finite.
    radius : int
        References on either side: a window has 2 * radius + 1 of them.

    Returns
    -------
    enhanced : float32 array, shape (Q, R)
        0 where a window is constant. Sums are float64 within a row only, so that each row's
        result depends on nothing but the row.
    """
    columns, n = np.arange(differences.shape[1]), differences.shape[1]
    count = np.minimum(columns + radius + 1, n) - np.maximum(columns - radius, 0)
    enhanced = np.empty(differences.shape, np.float32)
    for start in range(0, len(differences), BLOCK_ROWS):
        rows = differences[start : start + BLOCK_ROWS].astype(np.float64)
        enhanced[start : start + BLOCK_ROWS] = _enhance(rows, radius, count)
    return enhanced


def _enhance(rows: Array, radius: int, count: Array) -> Array:
    # Without the row's mean the squares are as small as they can be, and so is what rounding
    # leaves of their differences.
    rows -= rows.mean(axis=1, keepdims=True)
    squares = rows * rows
    nothing = FLAT * squares.max(axis=1, keepdims=True)
    mean = _window_sums(rows, radius) / count
    variance = _window_sums(squares, radius)
    variance -= count * mean * mean
    variance /= np.maximum(count - 1, 1)
    rows -= mean
    flat = variance <= nothing
    variance[flat] = 1
    rows[flat] = 0
    rows /= np.sqrt(variance, out=variance)
    return rows


def _window_sums(rows: Array, radius: int) -> Array:
    """Return the sums over each column's window, cut off at the ends."""
    n_rows, n = rows.shape
    running = np.zeros((n_rows, n + 2 * radius + 1))
    np.cumsum(rows, axis=1, out=running[:, radius + 1 : radius + 1 + n])
    running[:, radius + 1 + n :] = running[:, [radius + n]]
    sums: Array = running[:, 2 * radius + 1 :] - running[:, :n]
    return sums
