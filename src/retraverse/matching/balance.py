"""References that look like everything, held back: similarity balanced over rows and columns.

Some reference frames are alike to almost any query (hubs: fog, foliage, a blank wall) and win where
they should not. But on one drive a reference is the right one for few queries only, so what it
says of *most* queries is its habit, not its knowledge. Each query's row is brought to mean 0 and
standard deviation 1 over the map, then each reference's column likewise over the queries:
over the whole drive (`balance`, offline), or over the frames so far (`RunningBalance`, online: one
row in, one row out, O(R)). No labels; both see the query drive, which is not the truth.

Measured on four public drives with HOG and CoHOG, windows of 10 frames: accuracy rises in all
eight cases with `RunningBalance` (by 0.006 to 0.59) and in seven with `balance`; with stops,
changing speed, jumps and detours too, in nearly every case (`benchmarks/balance.py`). A drive that
stands in one place for most of its frames makes that place look like a hub: take stops out first
(`retraverse.images.without_stops`).
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import InputError, ShapeError
from retraverse.types import FloatArray

__all__ = ["PRIOR_FRAMES", "RunningBalance", "RunningHabit", "balance", "standardise"]

FLAT = 1e-7
"""A standard deviation below this share of the values' size is rounding, not a difference."""
PRIOR_FRAMES = 10
"""Frames' worth of belief, before any was seen, that a reference has no habit."""

Float64Array = NDArray[np.float64]


def balance(similarity: FloatArray) -> FloatArray:
    """Return the similarity matrix with rows, then columns, of mean 0 and standard deviation 1.

    Parameters
    ----------
    similarity : float array, shape (Q, R)
        Rows are queries of one drive, columns references; finite; at least two queries.

    Returns
    -------
    balanced : float32 array, shape (Q, R)
        In standard deviations; constant rows and columns are 0.

    Raises
    ------
    ShapeError
        If it has not two axes, or holds NaN or infinity.
    InputError
        If there are fewer than two queries.

    Notes
    -----
    Unchanged by any positive factor and any offset on each row.
    """
    rows = _checked(similarity)
    if len(rows) < 2:
        raise InputError(
            f"balance: got {len(rows)} queries, expected at least 2: it compares each reference "
            "over the whole query drive"
        )
    balanced = standardise(standardise(rows, axis=1), axis=0)
    return balanced.astype(np.float32)


class RunningHabit:
    """What each reference said of the queries so far: its mean and deviation, taken out of rows.

    The first frames are held near their own values by a prior: `PRIOR_FRAMES` frames' worth of
    mean 0 and standard deviation 1 for every reference.

    Parameters
    ----------
    n_references : int
    """

    def __init__(self, n_references: int) -> None:
        self._n_frames = PRIOR_FRAMES
        self._sums: Float64Array = np.zeros(n_references)
        # At least PRIOR_FRAMES, so that no variance is 0.
        self._squares: Float64Array = np.full(n_references, float(PRIOR_FRAMES))

    def take_out(self, row: NDArray[np.floating]) -> Float64Array:
        """Return a row of mean 0 and deviation 1 without the habits, its own part included."""
        self._n_frames += 1
        self._sums += row
        self._squares += np.square(row, dtype=np.float64)
        mean = self._sums / self._n_frames
        variance = self._squares / self._n_frames
        variance -= np.square(mean)
        balanced: Float64Array = row - mean
        balanced /= np.sqrt(variance, out=variance)
        return balanced


class RunningBalance:
    """`balance` frame by frame: each row is balanced by the rows up to it.

    See `RunningHabit` for the first frames.

    Parameters
    ----------
    n_references : int
    """

    def __init__(self, n_references: int) -> None:
        self._n_references = n_references
        self._habit = RunningHabit(n_references)

    def update(self, row: FloatArray) -> FloatArray:
        """Return one query's balanced similarities, float32 (R,).

        Parameters
        ----------
        row : float array, shape (R,)
            The next frame's similarity with every reference.

        Raises
        ------
        ShapeError
            If it is of another length, or holds NaN or infinity.
        """
        if np.shape(row) != (self._n_references,):
            raise ShapeError(f"row: got shape {np.shape(row)}, expected ({self._n_references},)")
        standard = standardise(_checked(np.asarray(row)[np.newaxis]), axis=1)[0]
        return self._habit.take_out(standard).astype(np.float32)


def standardise(values: Float64Array, axis: int) -> Float64Array:
    """Return them with mean 0 and standard deviation 1 along an axis; constant: all 0."""
    deviation = values.std(axis=axis, keepdims=True)
    size = np.abs(values).max(axis=axis, keepdims=True, initial=0)
    differs = deviation > FLAT * size
    centred = values - values.mean(axis=axis, keepdims=True)
    scaled: Float64Array = centred * differs / np.where(differs, deviation, 1)
    return scaled


def _checked(similarity: FloatArray) -> Float64Array:
    values = np.asarray(similarity, np.float64)
    if values.ndim != 2 or values.shape[1] == 0:
        raise ShapeError(
            f"similarity: got shape {values.shape}, expected (queries, references) of at least "
            "one reference"
        )
    if not np.isfinite(values).all():
        raise ShapeError("similarity: holds NaN or infinity, expected finite numbers")
    return values
