"""NumPy twins of the compiled diagonal kernels, bit for bit the same.

They take the same arguments, write into the same output arrays and run where nothing
was compiled; arguments have been checked by `retraverse.kernels.diagonal`. Each works row
by row, so that no second matrix is made.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from retraverse.types import FloatArray, IntArray

__all__ = [
    "best_diagonals",
    "best_from_sums",
    "diagonal_scores",
    "diagonal_sums",
    "scores_from_sums",
]

DoubleArray = NDArray[np.float64]


def diagonal_scores(
    similarity: FloatArray, length: int, quantum: float, scores: FloatArray
) -> None:
    """Write the score of every window of `length` frames."""
    for query, sums in enumerate(_window_sums(similarity, length, quantum)):
        scores[query] = sums / length


def best_diagonals(
    similarity: FloatArray, length: int, quantum: float, reference: IntArray, score: FloatArray
) -> None:
    """Write the first best window of each query window of `length` frames."""
    for query, sums in enumerate(_window_sums(similarity, length, quantum)):
        reference[query], score[query] = _first_best(sums, length)


def diagonal_sums(similarity: FloatArray, quantum: float, sums: DoubleArray) -> None:
    """Write the running sums of all diagonals, one row and column larger than the matrix."""
    sums[0] = 0.0
    sums[:, 0] = 0.0
    for query, row in enumerate(similarity):
        np.add(sums[query, :-1], _rounded(row, quantum), out=sums[query + 1, 1:])


def scores_from_sums(sums: DoubleArray, length: int, scores: FloatArray) -> None:
    """Write the score of every window of `length` frames, from the running sums."""
    for query in range(len(scores)):
        scores[query] = (sums[query + length, length:] - sums[query, :-length]) / length


def best_from_sums(
    sums: DoubleArray, lengths: IntArray, reference: IntArray, score: FloatArray
) -> None:
    """Write the first best window of each query window with its own length."""
    for query, length in enumerate(lengths.tolist()):
        window = sums[query + length, length:] - sums[query, :-length]
        reference[query], score[query] = _first_best(window, length)


def _window_sums(similarity: FloatArray, length: int, quantum: float) -> Iterator[DoubleArray]:
    """Yield, for each query window, the sums of its reference windows."""
    running = np.zeros(similarity.shape[1] + 1)
    for query, row in enumerate(similarity):
        step = _rounded(row, quantum)
        if query >= length:
            step[length:] -= _rounded(similarity[query - length, : len(row) - length], quantum)
        running[1:] = running[:-1] + step
        if query + 1 >= length:
            yield running[length:]


def _rounded(row: FloatArray, quantum: float) -> DoubleArray:
    """Nearest multiples of `quantum`: all their sums are exact."""
    shift = 1.5 * 2.0**52 * quantum
    return (row.astype(np.float64) + shift) - shift


def _first_best(sums: DoubleArray, length: int) -> tuple[int, np.float32]:
    means = (sums / length).astype(np.float32)
    best = int(means.argmax())
    return best, means[best]
