"""The mean of the diagonal: the thesis' own way of matching a sequence."""

from collections import deque
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from retraverse.matching.checks import check_lengths_fit, check_row, checked_similarity
from retraverse.matching.matchers.base import Answer
from retraverse.matching.matchers.registry import register
from retraverse.matching.matches import Matches
from retraverse.matching.windows import match_diagonals
from retraverse.types import Array, FloatArray

__all__ = ["Mean", "MeanParameters"]


@dataclass(frozen=True)
class MeanParameters:
    """The mean of the diagonal has none."""


@register(MeanParameters)
class Mean:
    """Mean similarity of K pairs, one reference per query frame (algorithms 4 and 5).

    A window is named by its first frame and answered by its first reference, the lowest of equals;
    its score is the mean. It never answers "no match": a threshold on the score does.
    """

    name: ClassVar[str] = "mean"
    summary: ClassVar[str] = "Mean of the diagonal: one map frame per query frame"
    citation: ClassVar[str] = (
        "Tomiță, Zaffar, Milford, McDonald-Maier, Ehsan, ConvSequential-SLAM, IEEE Access, 2021"
    )
    cost: ClassVar[str] = "O(Q R) whatever K; no memory beside the matrix"
    assumes: ClassVar[str] = "the map's speed, and that every frame is on the map"
    frame_by_frame: ClassVar[bool] = True

    def __init__(self, parameters: MeanParameters | None = None) -> None:
        self.parameters = parameters or MeanParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        n_queries, n_references = scores.shape
        check_lengths_fit(n_queries, n_references, sequence_length)
        lengths = np.full(n_queries - sequence_length + 1, sequence_length, np.int64)
        reference, score = match_diagonals([(0, scores)], lengths)
        return Matches(
            query=np.arange(len(lengths)),
            reference=reference,
            score=score,
            sequence_length=lengths,
            n_queries=n_queries,
            n_references=n_references,
        )

    def online(self, n_references: int, sequence_length: int) -> "OnlineMean":
        """See `Matcher.online`: an answer comes with the last frame of its window."""
        check_lengths_fit(sequence_length, n_references, sequence_length)
        return OnlineMean(n_references, sequence_length)


class OnlineMean:
    """Running sums of K rows along the diagonals: O(R) a frame, whatever K.

    Rows are rounded to multiples of 2^-30 of the largest power of two they reach, so that sums are
    exact in float64 and do not drift however long the drive.
    """

    def __init__(self, n_references: int, sequence_length: int) -> None:
        self._n_references = n_references
        self._length = sequence_length
        self._rows: deque[Array] = deque()
        self._sums = np.zeros(n_references + 1)
        self._quantum = 0.0
        self._n_seen = 0

    def update(self, row: FloatArray) -> Answer | None:
        """See `OnlineMatcher.update`."""
        scores = check_row(row, self._n_references)[0].astype(np.float64)
        self._refine(float(np.abs(scores).max()))
        self._add(scores)
        self._n_seen += 1
        if self._n_seen < self._length:
            return None
        means = (self._sums[self._length :] / self._length).astype(np.float32)
        best = int(means.argmax())
        return Answer(self._n_seen - self._length, best, float(means[best]), self._length)

    def finish(self) -> list[Answer]:
        """Return none: every window was answered when its last frame came."""
        return []

    def _refine(self, largest: float) -> None:
        """Take a coarser quantum where a larger score has come, and add up anew."""
        if largest <= 2.0**30 * self._quantum:
            return
        self._quantum = float(np.ldexp(1.0, int(np.frexp(largest)[1]) - 30))
        kept, self._rows = self._rows, deque()
        self._sums = np.zeros(self._n_references + 1)
        for row in kept:
            self._add(row)

    def _add(self, row: Array) -> None:
        step = self._rounded(row)
        if len(self._rows) == self._length:
            leaving = self._rows.popleft()
            step[self._length :] -= self._rounded(leaving[: len(row) - self._length])
        self._sums[1:] = self._sums[:-1] + step
        self._rows.append(row)

    def _rounded(self, row: Array) -> Array:
        return np.rint(row / self._quantum) * self._quantum if self._quantum else row.copy()
