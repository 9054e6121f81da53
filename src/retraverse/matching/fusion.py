"""Several techniques' similarity matrices made into one.

Techniques fail in different places, so their agreement says more than any one of them. Their
similarities have different units (0.88 to 0.93 for one, 0.2 to 0.5 for another), so each must be
brought to a common scale first:

``sum`` (default)
    Each query's similarities, per technique, to mean 0 and standard deviation 1 over the map;
    then the mean over techniques. A technique counts by how far its favourites stand out *for
    this query*. Standard deviations rather than minimum and maximum, which two cells decide.
``rank``
    The mean of ranks: throws away by how much a reference is ahead.
``switch``
    For each query the one technique that is surest: whose best reference is furthest ahead of the
    best one elsewhere (uniqueness, in standard deviations). The others' votes are lost.
``balanced``
    As ``sum``, then references that look like everything lose their advantage (`balance`). Needs
    the whole query drive, so it is for offline use; the other modes treat every row by itself.

All modes ignore the order of techniques and any change of scale or offset (positive affine) of a
technique's similarities. A technique that says the same of every reference, as one without
keypoints does, has no vote in that row.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.matching.balance import balance, standardise
from retraverse.types import FloatArray

__all__ = ["FusionMode", "fuse", "uniqueness"]

FusionMode = Literal["sum", "rank", "switch", "balanced"]
EXCLUDED = 5
"""References on either side of the best that are the same place: uniqueness looks beyond."""

Float64Array = NDArray[np.float64]


def fuse(similarities: Sequence[FloatArray], mode: FusionMode = "sum") -> FloatArray:
    """Return one similarity matrix made of several techniques'.

    Parameters
    ----------
    similarities : sequence of float arrays, each of shape (Q, R)
        One per technique: rows queries, columns references, higher is more alike; finite.
    mode : {"sum", "rank", "switch", "balanced"}
        See the head of this module.

    Returns
    -------
    fused : float32 array, shape (Q, R)
        For `match_similarity`. ``sum`` and ``switch`` in standard deviations over the references,
        ``balanced`` over the queries, ``rank`` in [0, 1].

    Raises
    ------
    ConfigError
        If the mode is unknown.
    InputError
        If there is no matrix, or for ``balanced`` fewer than two queries.
    ShapeError
        If the matrices differ in shape, have no references, or hold NaN or infinity.

    Notes
    -----
    Measured on published matrices of ten techniques (Corridor, single frames): ``sum`` gives
    0.685 from the three cheap ones (CALC, CoHOG, HOG), whose best has 0.622, and 0.919 from all
    ten, whose best has 0.901; ``rank`` (0.595, 0.883) and ``switch`` (0.613, 0.820) lose to the
    best single technique; ``balanced`` gives 0.856 and 0.982. On drives where one technique is much
    worse than the other, the best single one beats ``sum``: see `docs/matching.md`.

    Examples
    --------
    >>> bold = np.array([[0.1, 0.9, 0.2]], np.float32)
    >>> shy = np.array([[0.60, 0.61, 0.62]], np.float32)
    >>> int(fuse([bold, shy]).argmax())
    1
    """
    if mode not in get_args(FusionMode):
        raise ConfigError(
            f"unknown fusion mode: got {mode!r}, expected one of {', '.join(get_args(FusionMode))}"
        )
    matrices = _check(similarities)
    if mode == "rank":
        return _mean([_ranks(matrix) for matrix in matrices])
    standard = [standardise(matrix, axis=1) for matrix in matrices]
    if mode == "switch":
        return _surest(standard)
    fused = _mean(standard)
    return fused if mode == "sum" else balance(fused)


def uniqueness(similarity: FloatArray, *, excluded: int = EXCLUDED) -> Float64Array:
    """Return how far ahead each query's best reference is of the best one elsewhere.

    Parameters
    ----------
    similarity : float array, shape (Q, R)
    excluded : int of at least 0
        References on either side of the best one that count as the same place.

    Returns
    -------
    uniqueness : float64 array, shape (Q,)
        In standard deviations of the row, from 0 up, unless the best has no elsewhere: then 0.
    """
    return _lead(standardise(_check([similarity])[0], axis=1), excluded)


def _check(similarities: Sequence[FloatArray]) -> list[Float64Array]:
    """Return the matrices as float64, or raise."""
    matrices = [np.asarray(matrix, np.float64) for matrix in similarities]
    if not matrices:
        raise InputError("fuse: got no similarity matrix, expected one per technique")
    for number, matrix in enumerate(matrices):
        if matrix.ndim != 2 or matrix.shape != matrices[0].shape or matrix.shape[1] == 0:
            raise ShapeError(
                f"similarities[{number}]: got shape {matrix.shape}, expected (queries, references) "
                f"of at least one reference, the same for all (the first: {matrices[0].shape})"
            )
        if not np.isfinite(matrix).all():
            raise ShapeError(
                f"similarities[{number}]: holds NaN or infinity, expected finite numbers"
            )
    return matrices


def _ranks(matrix: Float64Array) -> Float64Array:
    """Return each row's ranks from 0 (least alike) to 1; equals share the mean of theirs."""
    last = max(matrix.shape[1] - 1, 1)
    ranks = np.empty_like(matrix)
    for row, values in enumerate(matrix):
        ordered = np.sort(values)
        below = np.searchsorted(ordered, values, side="left")
        up_to = np.searchsorted(ordered, values, side="right")
        ranks[row] = (below + up_to - 1) / (2 * last)
    return ranks


def _mean(matrices: list[Float64Array]) -> FloatArray:
    # Summed in the order of their values, cell by cell, so that the order given cannot matter.
    stacked = np.sort(np.stack(matrices), axis=0)
    return np.asarray(stacked.mean(axis=0), np.float32)


def _surest(standard: list[Float64Array]) -> FloatArray:
    """Return for each query the row of the technique whose best is furthest ahead."""
    chosen = np.stack([_lead(matrix, EXCLUDED) for matrix in standard]).argmax(axis=0)
    rows = np.stack(standard)[chosen, np.arange(len(chosen))]
    return np.asarray(rows, np.float32)


def _lead(rows: Float64Array, excluded: int) -> Float64Array:
    """Return (Q,): each row's best less its best further than `excluded` from there."""
    best = rows.argmax(axis=1)
    distance = np.abs(np.arange(rows.shape[1]) - best[:, np.newaxis])
    second = np.where(distance > excluded, rows, -np.inf).max(axis=1)
    return np.where(np.isfinite(second), rows.max(axis=1) - second, 0.0)
