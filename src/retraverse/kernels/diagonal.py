"""Sequence scores: means along the diagonals of a similarity matrix.

Conventions: rows are queries, columns references, higher is better; a window that
starts at query i and reference j with K frames scores the mean of
similarity[i + t, j + t], t = 0..K-1. The cost of one length does not depend on K.

Exactness: entries are first rounded to a multiple of a power of two so small (below
1e-12 of the largest entry for any traverse under 4,000 frames) that every sum is
exact in float64. Scores therefore do not drift along a traverse; windows whose means
are equal as float32 tie exactly, and the lowest reference wins; the same window gets the
same score from every function here.

Source: ConvSequential-SLAM thesis, algorithms 2, 4 and 5, equations 4.1 to 4.6.
"""

import math
from numbers import Integral
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from retraverse.errors import InputError, ShapeError
from retraverse.kernels import numpy_diagonal
from retraverse.kernels.backend import native
from retraverse.types import FloatArray, IntArray

__all__ = [
    "BestDiagonals",
    "DiagonalSums",
    "best_diagonals",
    "best_diagonals_variable",
    "diagonal_scores",
]


class BestDiagonals(NamedTuple):
    """The best reference window for each of W query windows."""

    reference: IntArray
    """int64 (W,): first reference frame of the best window; the lowest one on ties."""
    score: FloatArray
    """float32 (W,): mean similarity of its pairs."""


def diagonal_scores(similarity: FloatArray, sequence_length: int) -> FloatArray:
    """Return the score of every window of `sequence_length` frames.

    Parameters
    ----------
    similarity : float32 array, shape (Q, R)
        Finite scores of all pairs.
    sequence_length : int in 1..min(Q, R)
        K, frames per window.

    Returns
    -------
    scores : float32 array, shape (Q - K + 1, R - K + 1)

    Raises
    ------
    InputError
        If an entry is not finite (names the first one) or K does not fit.
    ShapeError
        If `similarity` has not two axes.

    References
    ----------
    ConvSequential-SLAM thesis, algorithm 4.
    """
    similarity, quantum = _checked(similarity)
    _check_length(sequence_length, similarity.shape)
    scores = np.empty(_n_windows(similarity.shape, sequence_length), dtype=np.float32)
    _kernels().diagonal_scores(similarity, sequence_length, quantum, scores)
    return scores


def best_diagonals(similarity: FloatArray, sequence_length: int) -> BestDiagonals:
    """Return the best reference window for every query window, without storing the scores.

    Takes O(Q R) time for any length and two rows of memory. For several lengths
    of one matrix use `DiagonalSums`.

    Parameters
    ----------
    similarity : float32 array, shape (Q, R)
        Finite scores of all pairs.
    sequence_length : int in 1..min(Q, R)
        K, frames per window.

    Returns
    -------
    best : BestDiagonals
        Of W = Q - K + 1 windows: the last K - 1 queries start none.

    Raises
    ------
    InputError
        If an entry is not finite (names the first one) or K does not fit.
    ShapeError
        If `similarity` has not two axes.

    References
    ----------
    ConvSequential-SLAM thesis, algorithms 4 and 5.
    """
    similarity, quantum = _checked(similarity)
    _check_length(sequence_length, similarity.shape)
    best = _empty_best(similarity.shape[0] - sequence_length + 1)
    _kernels().best_diagonals(similarity, sequence_length, quantum, *best)
    return best


def best_diagonals_variable(similarity: FloatArray, lengths: ArrayLike) -> BestDiagonals:
    """Return the best reference window for query windows that each have their own length.

    See `DiagonalSums.best_variable`, whose arguments and errors these are.
    """
    return DiagonalSums(similarity).best_variable(lengths)


class DiagonalSums:
    """Running sums of all diagonals, from which every sequence length follows.

    Made once in O(Q R), in twice the memory of the matrix; each length then costs one
    subtraction a window.

    Parameters
    ----------
    similarity : float32 array, shape (Q, R)
        Finite scores of all pairs.

    Attributes
    ----------
    sums : float64 array, shape (Q + 1, R + 1)
        sums[i, j] = similarity[i - 1, j - 1] + similarity[i - 2, j - 2] + ...

    Raises
    ------
    InputError
        If an entry is not finite (names the first one).
    ShapeError
        If `similarity` has not two axes.

    Examples
    --------
    >>> sums = DiagonalSums(np.eye(4, dtype=np.float32))
    >>> sums.best(3).reference.tolist(), sums.best(3).score.tolist()
    ([0, 1], [1.0, 1.0])
    """

    def __init__(self, similarity: FloatArray) -> None:
        similarity, quantum = _checked(similarity)
        self.sums: NDArray[np.float64] = np.empty(np.add(similarity.shape, 1), dtype=np.float64)
        _kernels().diagonal_sums(similarity, quantum, self.sums)

    @property
    def shape(self) -> tuple[int, int]:
        """(Q, R): number of query and reference frames."""
        return self.sums.shape[0] - 1, self.sums.shape[1] - 1

    def scores(self, sequence_length: int) -> FloatArray:
        """Return what `diagonal_scores` returns for this length."""
        _check_length(sequence_length, self.shape)
        scores = np.empty(_n_windows(self.shape, sequence_length), dtype=np.float32)
        _kernels().scores_from_sums(self.sums, sequence_length, scores)
        return scores

    def best(self, sequence_length: int) -> BestDiagonals:
        """Return what `best_diagonals` returns for this length."""
        _check_length(sequence_length, self.shape)
        n_windows = self.shape[0] - sequence_length + 1
        return self._best(np.full(n_windows, sequence_length, dtype=np.int64))

    def best_variable(self, lengths: ArrayLike) -> BestDiagonals:
        """Return the best reference window for windows that each have their own length.

        Parameters
        ----------
        lengths : int array, shape (W,)
            K of the window that starts at query 0, 1, ..., W - 1; each at most R, and
            none reaching past the last query.

        Returns
        -------
        best : BestDiagonals
            Of W windows.

        Raises
        ------
        InputError
            If a window does not fit; names the first one.
        ShapeError
            If `lengths` is not one row of whole numbers.

        References
        ----------
        ConvSequential-SLAM thesis, algorithms 2 and 3 (dynamic sequence length).
        """
        checked = np.asarray(lengths)
        if checked.ndim != 1 or (checked.size and checked.dtype.kind not in "iu"):
            raise ShapeError(
                f"lengths are {checked.dtype} of shape {checked.shape}; expected integers, one axis"
            )
        _check_lengths(checked, self.shape)
        return self._best(np.ascontiguousarray(checked, dtype=np.int64))

    def _best(self, lengths: IntArray) -> BestDiagonals:
        best = _empty_best(len(lengths))
        _kernels().best_from_sums(self.sums, lengths, *best)
        return best


def _kernels() -> ModuleType:
    return native() or numpy_diagonal


def _checked(similarity: ArrayLike) -> tuple[FloatArray, float]:
    """Return the matrix as contiguous float32, and the quantum its entries are rounded to."""
    similarity = np.asarray(similarity)
    if similarity.ndim != 2:
        raise ShapeError(f"similarity has shape {similarity.shape}; expected (queries, references)")
    with np.errstate(over="ignore"):  # a float64 too large becomes infinite, which is refused below
        matrix = np.ascontiguousarray(similarity, dtype=np.float32)
    if matrix.size == 0:
        return matrix, 1.0
    highest, lowest = float(matrix.max()), float(matrix.min())  # NaN if any entry is
    if not (math.isfinite(highest) and math.isfinite(lowest)):
        _raise_not_finite(matrix)
    return matrix, _quantum(max(highest, -lowest), min(matrix.shape))


def _quantum(largest: float, n_frames: int) -> float:
    """Smallest power of two of which any diagonal's sum is fewer than 2^53 multiples."""
    _, exponent = math.frexp(largest * max(n_frames, 2))
    return math.ldexp(1.0, exponent - 52)


def _raise_not_finite(matrix: FloatArray) -> None:
    query, reference = np.argwhere(~np.isfinite(matrix))[0]
    raise InputError(
        f"similarity[{query}, {reference}] is {matrix[query, reference]}; expected finite scores:"
        " was a descriptor empty or not finite?"
    )


def _check_length(sequence_length: int, shape: tuple[int, ...]) -> None:
    n_queries, n_references = shape
    longest = min(n_queries, n_references)
    if not isinstance(sequence_length, Integral) or not 1 <= sequence_length <= longest:
        raise InputError(
            f"sequence length is {sequence_length}; expected a whole number from 1 to {longest},"
            f" for {n_queries} query and {n_references} reference frames"
        )


def _check_lengths(lengths: IntArray, shape: tuple[int, int]) -> None:
    n_queries, n_references = shape
    room = np.minimum(n_queries - np.arange(len(lengths)), n_references)
    wrong = (lengths < 1) | (lengths > room)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise InputError(
            f"window at query {first} has length {lengths[first]}; expected 1 to {room[first]},"
            f" for {n_queries} query and {n_references} reference frames"
        )


def _n_windows(shape: tuple[int, ...], sequence_length: int) -> tuple[int, int]:
    return shape[0] - sequence_length + 1, shape[1] - sequence_length + 1


def _empty_best(n_windows: int) -> BestDiagonals:
    reference = np.empty(n_windows, dtype=np.int64)
    return BestDiagonals(reference, np.empty(n_windows, dtype=np.float32))
