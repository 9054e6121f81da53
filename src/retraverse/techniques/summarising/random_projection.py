"""Gaussian random projection: long vectors made short, distances nearly kept."""

import numpy as np

from retraverse.types import FloatArray

__all__ = ["gaussian_projection"]

_ROWS = 64
"""Rows drawn at once: they are drawn in float64, twice the size of what is kept."""


def gaussian_projection(length: int, dimension: int, *, seed: int = 0) -> FloatArray:
    """Return the matrix (length, dimension) that projects columns, float32.

    The numbers are those of NumPy's legacy generator (``np.random.seed(seed)`` and then
    ``np.random.randn(length, dimension)``), which published descriptors were made with. A longer
    projection begins with the rows of a shorter one.
    """
    random = np.random.RandomState(seed)
    matrix = np.empty((length, dimension), np.float32)
    for start in range(0, length, _ROWS):
        rows = matrix[start : start + _ROWS]
        rows[:] = random.standard_normal(rows.shape)
    return matrix
