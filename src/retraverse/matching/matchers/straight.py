"""What SeqSLAM and OpenSeqSLAM2 share: straight trajectories in windows of enhanced differences.

Both look at T rows at a time, enhanced by local contrast, for the straight line of the least sum
(`Lines` says which lines there are), and judge it by the best one elsewhere. The window answers
for its middle frame; the frames before the first middle and after the last follow the first and
last line.

Scores are 1 - best / second, in [0, 1]: 0 where the second best line, outside the neighbourhood of
the best, is as good (or where there is no such line), 1 where nothing is like it. "Uniqueness" is
the ratio itself in OpenSeqSLAM, its inverse in OpenSeqSLAM2.
"""

from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from retraverse.errors import InputError
from retraverse.kernels import BestTrajectories
from retraverse.matching.checks import check_lengths_fit, check_row, checked_similarity
from retraverse.matching.matchers.base import Answer
from retraverse.matching.matchers.contrast import enhance_contrast
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.types import Array, FloatArray, IntArray

__all__ = ["Lines", "StraightMatcher"]


@dataclass(frozen=True)
class Lines:
    """The lines a window is searched for."""

    offsets: IntArray
    """int64 (S, T): reference of line s at row t, from the line's anchor."""
    middle: int
    """The row of a window that it answers for."""

    @property
    def n_rows(self) -> int:
        """T: query frames in a window."""
        return int(self.offsets.shape[1])

    @property
    def shortest(self) -> int:
        """References the flattest line passes: a map needs as many."""
        return int(np.ptp(self.offsets, axis=1).min()) + 1


class StraightMatcher(ABC):
    """A matcher that searches windows of enhanced differences for lines."""

    name: ClassVar[str]
    frame_by_frame: ClassVar[bool] = True

    def __init__(self, parameters: Any) -> None:
        self.parameters = parameters

    @abstractmethod
    def lines(self, sequence_length: int) -> Lines:
        """Return the lines of a window."""

    @abstractmethod
    def search(self, enhanced: FloatArray, lines: Lines) -> BestTrajectories:
        """Return the best line of every window of `enhanced` rows, and the best elsewhere."""

    @abstractmethod
    def answers(self, found: BestTrajectories, lines: Lines) -> IntArray:
        """Return int64 (W,): the reference each window answers."""

    def distances(self, sums: FloatArray, lines: Lines, least: float) -> FloatArray:
        """Return sums along lines as distances from 0, given the least entry of the matrix."""
        return sums - np.float32(lines.n_rows * least)

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        lines = self._fitting_lines(scores.shape[0], scores.shape[1], sequence_length)
        enhanced = self._enhance(scores)
        found = self.search(enhanced, lines)
        n_windows = len(found.anchor)
        matches = Matches(
            query=np.arange(n_windows) + lines.middle,
            reference=self.answers(found, lines),
            score=self._scores(found, lines, float(enhanced.min())),
            sequence_length=np.full(n_windows, lines.n_rows),
            n_queries=scores.shape[0],
            n_references=scores.shape[1],
        )
        return self._refuse(_follow(matches, found, lines), enhanced, lines)

    def online(self, n_references: int, sequence_length: int) -> "OnlineLines":
        """See `Matcher.online`: an answer comes with the last frame of its window.

        References are those of `match`. Scores are too once the least enhanced difference of the
        drive has been seen; until then they take the least so far.
        """
        lines = self.lines(sequence_length)
        self._fitting_lines(max(lines.n_rows, sequence_length), n_references, sequence_length)
        return OnlineLines(self, lines, n_references)

    def _fitting_lines(self, n_queries: int, n_references: int, sequence_length: int) -> Lines:
        check_lengths_fit(n_queries, n_references, sequence_length)
        lines = self.lines(sequence_length)
        for what, has, needs in (
            ("query", n_queries, lines.n_rows),
            ("map", n_references, lines.shortest),
        ):
            if has < needs:
                raise InputError(
                    f"sequence_length {sequence_length}: the {what} has only {has} frames; "
                    f"{self.name} needs at least {needs} for it"
                )
        return lines

    def _enhance(self, scores: FloatArray) -> FloatArray:
        return enhance_contrast(-scores, self.parameters.contrast_window // 2)

    def _scores(self, found: BestTrajectories, lines: Lines, least: float) -> FloatArray:
        best = self.distances(found.best, lines, least)
        second = self.distances(found.second, lines, least)
        known = np.isfinite(second) & (second > 0)
        ratio = np.divide(best, second, out=np.ones_like(best), where=known)
        return np.asarray(np.maximum(1 - ratio, 0), np.float32)

    def _refuse(self, matches: Matches, enhanced: FloatArray, lines: Lines) -> Matches:
        """Refuse windows that hold no information, and those that are not unique enough."""
        informed = np.asarray(enhanced.any(axis=1))
        empty = [not informed[start : start + lines.n_rows].any() for start in range(len(matches))]
        return matches.refuse(np.array(empty, np.bool_)).refuse_below(
            1 - self.parameters.uniqueness
        )


class OnlineLines:
    """A `StraightMatcher` at work; it keeps one window of enhanced rows."""

    def __init__(self, matcher: StraightMatcher, lines: Lines, n_references: int) -> None:
        self._matcher = matcher
        self._lines = lines
        self._n_references = n_references
        self._rows: deque[Array] = deque(maxlen=lines.n_rows)
        self._least = np.inf
        self._n_seen = 0

    def update(self, row: FloatArray) -> Answer | None:
        """See `OnlineMatcher.update`."""
        enhanced = self._matcher._enhance(check_row(row, self._n_references))[0]
        self._rows.append(enhanced)
        self._least = min(self._least, float(enhanced.min()))
        self._n_seen += 1
        if self._n_seen < self._lines.n_rows:
            return None
        return self._answer(np.stack(self._rows))

    def finish(self) -> list[Answer]:
        """Return none: every window was answered when its last frame came."""
        return []

    def _answer(self, rows: FloatArray) -> Answer:
        found = self._matcher.search(rows, self._lines)
        score = float(self._matcher._scores(found, self._lines, self._least)[0])
        reference = int(self._matcher.answers(found, self._lines)[0])
        unique = score >= np.float32(1 - self._matcher.parameters.uniqueness)
        return Answer(
            query=self._n_seen - self._lines.n_rows + self._lines.middle,
            reference=reference if rows.any() and unique else NO_MATCH,
            score=score,
            sequence_length=self._lines.n_rows,
        )


def _follow(matches: Matches, found: BestTrajectories, lines: Lines) -> Matches:
    """Return the matches with every frame's reference: its window's, else along the end ones."""
    followed = np.full(matches.n_queries, NO_MATCH, np.int64)
    head, tail = lines.offsets[found.slope[[0, -1]]] + found.anchor[[0, -1], None]
    followed[: lines.middle] = head[: lines.middle]
    followed[matches.query] = matches.reference
    n_after = lines.n_rows - lines.middle - 1
    if n_after:
        followed[-n_after:] = tail[-n_after:]
    return replace(matches, followed=followed)
