"""Which reference frames show the place of a query: the truth that matches are judged by.

Conventions
- Query i, reference j, both from 0. ``positives[i]`` are the references that show the place of
  query i, rising; none at all means that query i truly has no match.
- Reference -1, as an answer, means "no match"; it is correct where there truly is none.

`truth_sources` makes a `GroundTruth` from files, aligned traverses, positions and lists.
"""

import logging
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from retraverse.errors import InputError, ShapeError
from retraverse.types import BoolArray, IntArray

__all__ = ["GroundTruth"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """The true matches of every query.

    Raises
    ------
    InputError
        If a list of positives is not int64, rising, at least 0 and below `n_references`.
    """

    positives: tuple[IntArray, ...]
    """Reference indices of each query, rising; empty = truly no match."""
    n_references: int | None
    """Frames of the map; None where the source does not say."""
    description: str
    """Where the truth comes from and what it tolerates, for reports."""
    tolerance_frames: int | None = None
    """Tolerance in frames as it was given, before any `select`; None if it is not in frames."""
    n_dropped: int = 0
    """Positives of the source that named references past the end of the map."""

    def __post_init__(self) -> None:
        for query, listed in enumerate(self.positives):
            if listed.dtype != np.int64 or listed.ndim != 1:
                raise InputError(
                    f"positives of query {query}: got {listed.dtype} of shape {listed.shape}, "
                    "expected int64 of one axis"
                )
        self._check_values()

    def _check_values(self) -> None:
        """Raise for indices that fall, repeat, or lie outside the map."""
        query, reference = self._pairs
        repeated = (np.diff(query) == 0) & (np.diff(reference) <= 0)
        outside = reference < 0
        if self.n_references is not None:
            outside |= reference >= self.n_references
        if outside.any():
            at = int(outside.argmax())
            end = "" if self.n_references is None else f" below {self.n_references}"
            raise InputError(
                f"positives of query {query[at]}: got reference {reference[at]}, "
                f"expected indices from 0{end}"
            )
        if repeated.any():
            raise InputError(
                f"positives of query {query[:-1][repeated][0]}: expected rising indices, "
                "each once; from_positives sorts them"
            )

    @property
    def n_queries(self) -> int:
        """Queries the truth is known for."""
        return len(self.positives)

    def has_match(self) -> BoolArray:
        """Return whether each query has a true match, shape (Q,)."""
        return self._counts > 0

    def is_correct(self, query: ArrayLike, reference: ArrayLike) -> BoolArray:
        """Return whether each pair of query and reference shows the same place.

        Parameters
        ----------
        query : int array
            Query indices, from 0.
        reference : int array, same shape
            Reference indices; -1 = answered "no match".

        Returns
        -------
        correct : bool array, same shape
            For -1: whether the query truly has no match. Past the end of the map: False.

        Raises
        ------
        InputError
            If a query is outside [0, n_queries).
        """
        queries, references = np.broadcast_arrays(
            np.asarray(query, np.int64), np.asarray(reference, np.int64)
        )
        if queries.size and not (queries.min() >= 0 and queries.max() < self.n_queries):
            raise InputError(
                f"query: got frames {queries.min()} to {queries.max()}, "
                f"expected 0 to {self.n_queries - 1}"
            )
        listed = np.isin(queries * self._stride + references, self._keys)
        within = (references >= 0) & (references < self._stride)
        refused_rightly = (references == -1) & (self._counts[queries] == 0)
        correct: BoolArray = (listed & within) | refused_rightly
        return correct

    def matrix(self, n_references: int | None = None) -> BoolArray:
        """Return all pairs: bool (Q, R), rows queries. R comes from the truth or the argument.

        Raises
        ------
        InputError
            If R is neither known nor given, or the truth is of a map of another size.
        """
        size = self.n_references if n_references is None else n_references
        if size is None:
            raise InputError(f"{self.description}: say n_references, the source does not")
        bounded = self.bounded(size)
        cells = np.zeros((self.n_queries, size), np.bool_)
        cells[bounded._pairs] = True
        return cells

    def bounded(self, n_references: int) -> "GroundTruth":
        """Return this truth for a map of `n_references` frames.

        Published files list references past the end of the map; where the source did not know the
        size of the map they are dropped here, with a warning in the log, and counted.

        Raises
        ------
        InputError
            If the truth is known to be of a map of another size.
        """
        if self.n_references == n_references:
            return self
        if self.n_references is not None:
            raise InputError(
                f"ground truth: it is of {self.n_references} references, the map has "
                f"{n_references}; expected the same traverse (were frames skipped or thinned?)"
            )
        kept = tuple(listed[listed < n_references] for listed in self.positives)
        n_dropped = sum(map(len, self.positives)) - sum(map(len, kept))
        truth = replace(self, positives=kept, n_references=n_references)
        return truth._with_dropped(n_dropped) if n_dropped else truth

    def _with_dropped(self, n_dropped: int) -> "GroundTruth":
        """Count dropped positives, in the description and in the log."""
        note = f"{n_dropped} positives past the last of {self.n_references} references dropped"
        _log.warning("%s: %s", self.description, note)
        return replace(
            self,
            n_dropped=self.n_dropped + n_dropped,
            description=f"{self.description}; {note}",
        )

    def select(
        self, query_indices: ArrayLike | None = None, reference_indices: ArrayLike | None = None
    ) -> "GroundTruth":
        """Return the truth of some frames, numbered anew in the order given.

        For traverses of which frames were skipped or thinned: pass the frames' indices in their
        source. A positive that was not kept disappears; a query that loses all of them has truly
        no match from then on.

        Parameters
        ----------
        query_indices, reference_indices : int array, optional
            Which frames are kept, each once. Default: all.

        Raises
        ------
        InputError
            If an index is repeated or outside the traverse.
        """
        queries = _kept(query_indices, self.n_queries, "query_indices")
        positives, n_references = self.positives, self.n_references
        if reference_indices is not None:
            references = _kept(reference_indices, self.n_references, "reference_indices")
            if _is_all(queries, self.n_queries) and _is_all(references, self.n_references):
                return self.bounded(len(references))
            positives, n_references = self._renumbered(references), len(references)
        elif _is_all(queries, self.n_queries):
            return self
        kept = tuple(positives[query] for query in queries)
        n_bereft = int(self.has_match()[queries].sum()) - sum(len(listed) > 0 for listed in kept)
        note = (
            f"{len(queries)} of {self.n_queries} queries and {_of(n_references, self.n_references)}"
            f" references kept, {n_bereft} queries left without a true match"
        )
        if self.tolerance_frames is not None:
            note += "; the tolerance counts the original frames"
        return replace(
            self,
            positives=kept,
            n_references=n_references,
            description=f"{self.description}; {note}",
        )

    def _renumbered(self, references: IntArray) -> tuple[IntArray, ...]:
        """Positives in the numbering of the kept references."""
        number = np.full(max(self._stride, int(references.max(initial=-1)) + 1), -1, np.int64)
        number[references] = np.arange(len(references))
        renumbered = (np.sort(number[listed]) for listed in self.positives)
        return tuple(listed[listed >= 0] for listed in renumbered)

    @cached_property
    def _pairs(self) -> tuple[IntArray, IntArray]:
        """All true pairs: their queries and their references."""
        references = np.concatenate([np.empty(0, np.int64), *self.positives])
        return np.repeat(np.arange(self.n_queries), self._counts), references

    @cached_property
    def _counts(self) -> IntArray:
        return np.array([len(listed) for listed in self.positives], np.int64)

    @cached_property
    def _stride(self) -> int:
        """One more than the last reference named: keys of two queries cannot meet."""
        return int(self._pairs[1].max(initial=-1)) + 1

    @cached_property
    def _keys(self) -> IntArray:
        query, reference = self._pairs
        return query * self._stride + reference


def _kept(indices: ArrayLike | None, n_frames: int | None, name: str) -> IntArray:
    """Return the indices of kept frames, or raise if one is repeated or outside the traverse."""
    if indices is None:
        return np.arange(n_frames or 0, dtype=np.int64)
    kept = np.asarray(indices)
    if kept.ndim != 1 or (kept.size and kept.dtype.kind not in "iu"):
        raise ShapeError(
            f"{name}: got {kept.dtype} of shape {kept.shape}, expected integers of one axis"
        )
    if kept.size and (kept.min() < 0 or (n_frames is not None and kept.max() >= n_frames)):
        end = "" if n_frames is None else f" to {n_frames - 1}"
        raise InputError(f"{name}: got {kept.min()} to {kept.max()}, expected frames from 0{end}")
    if np.unique(kept).size < kept.size:
        raise InputError(f"{name}: some frames are repeated; expected each once")
    return kept.astype(np.int64)


def _of(n_kept: int | None, n_all: int | None) -> str:
    return f"{'all' if n_kept is None else n_kept} of {'unknown' if n_all is None else n_all}"


def _is_all(kept: IntArray, n_frames: int | None) -> bool:
    """Whether these are all frames in their order; of an unknown number: the first ones."""
    return len(kept) == (n_frames or len(kept)) and np.array_equal(kept, np.arange(len(kept)))
