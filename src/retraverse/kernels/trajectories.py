"""Straight trajectories through a matrix of differences, the search at the heart of SeqSLAM.

Source: Milford and Wyeth, SeqSLAM: visual route-based navigation for sunny summer days and stormy
winter nights, ICRA 2012, section III.C.
"""

from typing import NamedTuple

import numpy as np

from retraverse.errors import InputError, ShapeError
from retraverse.kernels import numpy_trajectories
from retraverse.kernels.backend import default_threads, native
from retraverse.types import FloatArray, IntArray

__all__ = ["BestTrajectories", "best_trajectories"]


class BestTrajectories(NamedTuple):
    """The best trajectory of each of W windows."""

    anchor: IntArray
    """int64 (W,): reference it is anchored at; the lowest of equals."""
    slope: IntArray
    """int64 (W,): which row of the offsets it follows; the first of equals."""
    best: FloatArray
    """float32 (W,): sum of its differences; infinite where every trajectory leaves the matrix."""
    second: FloatArray
    """float32 (W,): least sum more than `radius` references away; infinite if there is none."""


def best_trajectories(
    differences: FloatArray, offsets: IntArray, *, radius: int, threads: int | None = None
) -> BestTrajectories:
    """Return the trajectory of the least sum for every window of rows.

    Parameters
    ----------
    differences : float32 array, shape (Q, R)
        Rows are queries, columns references, lower is more alike; finite.
    offsets : int64 array, shape (S, T)
        Row s, column t: references from the anchor at which slope s is at row t of the window.
    radius : int
        References on either side of the best that are left out of the search for the second best.
    threads : int, optional
        All cores open to this process, if not given.

    Returns
    -------
    trajectories : BestTrajectories
        Of W = Q - T + 1 windows.

    Raises
    ------
    ShapeError
        If an array has not two axes or another type.
    InputError
        If a window has more rows than there are.
    """
    for name, array, dtype in (("differences", differences, "f4"), ("offsets", offsets, "i8")):
        if array.ndim != 2 or array.dtype != np.dtype(dtype) or not array.flags.c_contiguous:
            raise ShapeError(
                f"{name}: got {array.dtype} of shape {array.shape}, expected contiguous "
                f"{np.dtype(dtype)} of two axes"
            )
    n_windows = len(differences) - offsets.shape[1] + 1
    if n_windows < 1 or differences.shape[1] == 0 or offsets.size == 0:
        raise InputError(
            f"differences of shape {differences.shape}: too few for trajectories of "
            f"{offsets.shape[1]} rows"
        )
    found = BestTrajectories(
        *(np.empty(n_windows, np.int64) for _ in range(2)),
        *(np.empty(n_windows, np.float32) for _ in range(2)),
    )
    kernels = native() or numpy_trajectories
    kernels.best_trajectories(
        differences, offsets, radius, default_threads() if threads is None else threads, *found
    )
    return found
