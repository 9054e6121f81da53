"""What every metric asks of its arrays, checked in one place.

Conventions
- ``correct[w]``: was the answer of window w right; ``score[w]``: how sure it was, higher is better.
- ``similarity[query, reference]`` and ``true_cells[query, reference]`` have one shape.
- NaN is never a score: it is an error, since a curve over it would be silently wrong.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from retraverse.errors import InputError, ShapeError
from retraverse.types import Array, BoolArray

__all__ = ["Float64Array", "cells", "decisions", "flags", "row_blocks"]

Float64Array = NDArray[np.float64]
"""Numbers on a curve: float64."""

BLOCK_CELLS = 1 << 20
"""Cells of a similarity matrix that are copied at once."""


def flags(values: ArrayLike, name: str) -> BoolArray:
    """Return `values` as a bool array of one axis; ShapeError if they are anything else."""
    array = np.asarray(values)
    if array.ndim != 1 or (array.dtype != np.bool_ and array.size):
        raise ShapeError(
            f"{name}: got {array.dtype} of shape {array.shape}, expected bool of one axis"
        )
    return array.astype(np.bool_)


def decisions(correct: ArrayLike, score: ArrayLike) -> tuple[BoolArray, Float64Array]:
    """Return `correct` as bool and `score` as float64, both (W,), or raise.

    Raises
    ------
    ShapeError
        If their shapes differ, or `correct` is not bool.
    InputError
        If a score is NaN.
    """
    is_right = flags(correct, "correct")
    scores = np.asarray(score, np.float64)
    if scores.shape != is_right.shape:
        raise ShapeError(f"score: got shape {scores.shape}, expected {is_right.shape} as correct")
    if np.isnan(scores).any():
        raise InputError(
            f"score: {int(np.isnan(scores).sum())} of {scores.size} are NaN, the first at "
            f"{int(np.isnan(scores).argmax())}; expected numbers (a descriptor of length zero?)"
        )
    return is_right, scores


def cells(similarity: ArrayLike, true_cells: ArrayLike) -> tuple[Array, BoolArray]:
    """Return both matrices (Q, R) as arrays, without copying, or raise ShapeError."""
    scores, truth = np.asarray(similarity), np.asarray(true_cells)
    if scores.ndim != 2 or scores.dtype.kind not in "fiu":
        raise ShapeError(
            f"similarity: got {scores.dtype} of shape {scores.shape}, "
            "expected numbers of two axes, queries x references"
        )
    if truth.shape != scores.shape or truth.dtype != np.bool_:
        raise ShapeError(
            f"true_cells: got {truth.dtype} of shape {truth.shape}, expected bool of shape "
            f"{scores.shape} as similarity (rows are queries: is one of them transposed?)"
        )
    return scores, truth


def row_blocks(similarity: Array) -> Iterator[tuple[slice, Array]]:
    """Yield slices of rows and those rows of `similarity`, about a million cells at a time.

    Raises
    ------
    InputError
        If a cell is NaN; the message names it.
    """
    n_queries, n_references = similarity.shape
    step = max(1, BLOCK_CELLS // max(1, n_references))
    for start in range(0, n_queries, step):
        rows = slice(start, min(start + step, n_queries))
        block = similarity[rows]
        if np.isnan(block).any():
            row, column = np.argwhere(np.isnan(block))[0]
            raise InputError(
                f"similarity: query {start + row}, reference {column} is NaN; "
                "expected numbers (a descriptor of length zero?)"
            )
        yield rows, block
