"""NumPy twin of the compiled trajectory search, bit for bit the same; it goes window by window."""

import numpy as np

from retraverse.types import FloatArray, IntArray

__all__ = ["best_trajectories"]


def best_trajectories(
    differences: FloatArray,
    offsets: IntArray,
    radius: int,
    threads: int,
    anchor: IntArray,
    slope: IntArray,
    best: FloatArray,
    second: FloatArray,
) -> None:
    """Write the best trajectory of every window and the best one elsewhere."""
    for window in range(len(anchor)):
        rows = differences[window : window + offsets.shape[1]]
        sums = np.stack([_sums(rows, steps) for steps in offsets])
        slopes = sums.argmin(axis=0)
        least = sums.min(axis=0)
        at = int(least.argmin())
        anchor[window], slope[window], best[window] = at, slopes[at], least[at]
        least[max(0, at - radius) : at + radius + 1] = np.inf
        second[window] = least.min()


def _sums(rows: FloatArray, steps: IntArray) -> FloatArray:
    """Return the sum along one slope from every anchor; infinite where it leaves the matrix."""
    n = rows.shape[1]
    first, end = max(0, -int(steps.min())), n - max(0, int(steps.max()))
    sums = np.full(n, np.inf, np.float32)
    if first < end:
        inside = np.zeros(end - first, np.float32)
        for row, step in zip(rows, steps.tolist(), strict=True):
            inside += row[first + step : end + step]
        sums[first:end] = inside
    return sums
