"""Recall@N: is a true match among the N most similar references of a query.

Also called Success@N or top-N accuracy; not the recall of a precision-recall curve. Papers differ
in the denominator (all queries, or those that have a true match), so both are given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from retraverse.errors import ConfigError
from retraverse.metrics.checks import cells, row_blocks
from retraverse.types import IntArray

__all__ = ["RecallAt", "recall_at", "true_match_rank"]

USUAL_N = (1, 5, 10, 20)


@dataclass(frozen=True)
class RecallAt:
    """Recall@N for several N, with both denominators."""

    all_queries: Mapping[int, float]
    """N -> share of all queries (VPR-Bench, VPR-methods-eval, AnyLoc)."""
    with_match: Mapping[int, float]
    """N -> share of the queries that have a true match (VPR_Tutorial, seqNet)."""
    n_queries: int
    """Denominator of `all_queries`."""
    n_with_match: int
    """Denominator of `with_match`."""


def recall_at(
    similarity: ArrayLike, true_cells: ArrayLike, *, n: Sequence[int] | None = None
) -> RecallAt:
    """Return Recall@N of a similarity matrix, with both denominators in use.

    Parameters
    ----------
    similarity : number array, shape (Q, R)
        Rows are queries, columns references, higher is better.
    true_cells : bool array, shape (Q, R)
        Which pairs show the same place.
    n : sequence of int in [1, R], optional
        Lengths of the list of candidates. Default: 1, 5, 10 and 20 as far as R goes.

    Returns
    -------
    RecallAt
        Shares in [0, 1], never falling with N; NaN where the denominator is 0.

    Raises
    ------
    ShapeError
        If the shapes differ or `true_cells` is not bool.
    InputError
        If a cell is NaN.
    ConfigError
        If an N is outside [1, R].

    Notes
    -----
    Of equally similar references the lower index comes first, as with `argmax`.
    """
    scores, truth = cells(similarity, true_cells)
    n_references = scores.shape[1]
    lengths = [length for length in USUAL_N if length <= n_references] if n is None else n
    for length in lengths:
        if not 1 <= length <= n_references:
            raise ConfigError(f"n: got {length}, expected 1 to {n_references}, the references")
    rank = true_match_rank(scores, truth)
    found = rank[rank > 0]
    hits = {int(length): int((found <= length).sum()) for length in lengths}
    return RecallAt(
        all_queries={length: _share(count, rank.size) for length, count in hits.items()},
        with_match={length: _share(count, found.size) for length, count in hits.items()},
        n_queries=rank.size,
        n_with_match=found.size,
    )


def true_match_rank(similarity: ArrayLike, true_cells: ArrayLike) -> IntArray:
    """Return the place of each query's best true match among all references: int64 (Q,).

    1 = the most similar reference is right; -1 = the query has no true match. Takes the arguments
    and raises the errors of `recall_at`. No sorting: O(Q R).
    """
    scores, truth = cells(similarity, true_cells)
    rank = np.full(len(scores), -1, np.int64)
    columns = np.arange(scores.shape[1])
    for rows, block in row_blocks(scores):
        held = truth[rows]
        has_match = held.any(axis=1)
        block, held = block[has_match], held[has_match]
        best = np.max(block, axis=1, keepdims=True, where=held, initial=_least(block.dtype))
        # The first of the best true references; equal ones before it come first, too.
        first = (held & (block == best)).argmax(axis=1, keepdims=True)
        ahead = (block > best) | ((block == best) & (columns < first))
        rank[rows][has_match] = 1 + ahead.sum(axis=1)
    return rank


def _least(dtype: np.dtype[np.generic]) -> float | int:
    return -np.inf if dtype.kind == "f" else int(np.iinfo(dtype).min)  # type: ignore[type-var]


def _share(count: int, total: int) -> float:
    return count / total if total else float("nan")
