"""How many cells of a large similarity matrix reach each of some thresholds, block by block."""

from dataclasses import dataclass

import numpy as np

from retraverse.metrics.checks import row_blocks
from retraverse.types import Array, IntArray

__all__ = ["CellCounts", "count_cells"]


@dataclass(frozen=True, eq=False)
class CellCounts:
    """Cells of a matrix against T rising thresholds."""

    n_at_least: IntArray
    """Cells whose score is at least each threshold, shape (T,)."""
    n_above: IntArray
    """Cells whose score is above each threshold, shape (T,)."""
    next_above: Array
    """The lowest score above each threshold, shape (T,); +inf where there is none."""
    n_cells: int
    """All cells."""
    lowest: float
    """The lowest score; +inf for a matrix of no cells."""


def count_cells(similarity: Array, thresholds: Array) -> CellCounts:
    """Count the cells of `similarity` (Q, R) that reach each of the rising `thresholds` (T,).

    Each block of rows is sorted by itself and the thresholds are looked up in it, so that a
    5,000 x 5,000 matrix needs a few megabytes beside itself.

    Raises
    ------
    InputError
        If a cell is NaN.
    """
    n_at_least = np.zeros(len(thresholds), np.int64)
    n_above = np.zeros(len(thresholds), np.int64)
    next_above = np.full(len(thresholds), np.inf)
    lowest = np.inf
    for _, block in row_blocks(similarity):
        ordered = np.append(np.sort(block, axis=None).astype(np.float64), np.inf)
        above = np.searchsorted(ordered[:-1], thresholds, "right")
        n_at_least += block.size - np.searchsorted(ordered[:-1], thresholds, "left")
        n_above += block.size - above
        next_above = np.minimum(next_above, ordered[above])
        lowest = min(lowest, float(ordered[0]))
    return CellCounts(n_at_least, n_above, next_above, similarity.size, lowest)
