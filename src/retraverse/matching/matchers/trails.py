"""Following the best path back: from where a search ended to where each frame was.

A trail holds, for some consecutive query frames, how the best path came to every state. States
are numbered; those below R are frames of the map, all others are no place on it.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from retraverse.kernels import GraphRows, ViterbiRows
from retraverse.matching.matchers.base import Answer
from retraverse.matching.matchers.evidence import RunningEvidence, along, window_means
from retraverse.matching.matches import NO_MATCH
from retraverse.types import Array, FloatArray, IntArray

__all__ = ["GraphTrail", "LaggedSearch", "PathSearch", "Trail", "ViterbiTrail", "lagged", "whole"]


class Trail(ABC):
    """How the best path came to every state of some consecutive query frames."""

    best: IntArray
    """(N,) the state in which the best path up to each frame ends."""

    @abstractmethod
    def before(self, frame: IntArray, state: IntArray) -> IntArray:
        """Return the states one frame earlier on the best paths to `state` at `frame`."""

    @abstractmethod
    def places(self, state: IntArray) -> IntArray:
        """Return the reference of each state, -1 = none."""

    @abstractmethod
    def join(self, trails: Sequence["Trail"]) -> "Trail":
        """Return one trail of all the frames of several, in order."""


class ViterbiTrail(Trail):
    """Of `kernels.viterbi`: states are the map's frames and -1, outside."""

    def __init__(self, rows: ViterbiRows, moves: IntArray) -> None:
        self._rows = rows
        self._moves = moves
        self.best = rows.best

    def before(self, frame: IntArray, state: IntArray) -> IntArray:
        """See `Trail`."""
        code = self._rows.pointers[frame, np.maximum(state, 0)]
        moved = state - self._moves[np.minimum(code, len(self._moves) - 1)]
        from_place = np.where(code == 254, self._rows.peaks[frame], moved)
        from_place = np.where(code == 255, NO_MATCH, from_place)
        return np.where(state < 0, self._rows.outside_from[frame], from_place)

    def places(self, state: IntArray) -> IntArray:
        """See `Trail`."""
        return state

    def join(self, trails: Sequence[Trail]) -> "ViterbiTrail":
        """See `Trail`."""
        rows = [trail._rows for trail in trails if isinstance(trail, ViterbiTrail)]
        joined = ViterbiRows(*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)))
        return ViterbiTrail(joined, self._moves)


class GraphTrail(Trail):
    """Of `kernels.graph`: states are the matching nodes, then the hidden ones."""

    def __init__(self, rows: GraphRows, moves: IntArray) -> None:
        self._rows = rows
        self._moves = moves
        self._n = rows.codes.shape[2]
        self.best = rows.best

    def before(self, frame: IntArray, state: IntArray) -> IntArray:
        """See `Trail`."""
        hidden = state >= self._n
        column = state - self._n * hidden
        code = self._rows.codes[frame, hidden.astype(np.int64), column]
        how = code & 63
        moved = column - self._moves[np.minimum(how, len(self._moves) - 1)]
        place = np.where(how == 63, self._rows.peaks[frame], moved)
        return np.asarray(place + self._n * (code >= 128))

    def places(self, state: IntArray) -> IntArray:
        """See `Trail`."""
        return np.where(state < self._n, state, NO_MATCH)

    def join(self, trails: Sequence[Trail]) -> "GraphTrail":
        """See `Trail`."""
        rows = [trail._rows for trail in trails if isinstance(trail, GraphTrail)]
        joined = GraphRows(*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)))
        return GraphTrail(joined, self._moves)


class PathSearch(Protocol):
    """A search for the best path that goes on from where it stopped."""

    def advance(self, evidence: FloatArray) -> Trail:
        """Take in rows of evidence and return their trail."""


def whole(trail: Trail, evidence: FloatArray, sequence_length: int) -> tuple[IntArray, FloatArray]:
    """Return the best path through the whole drive, and its scores.

    Returns
    -------
    reference : int64 array, shape (Q,)
    score : float32 array, shape (Q,)
        Mean evidence of the path from each frame to the K - 1 after it, refused frames left out.
    """
    n_queries = len(trail.best)
    state = np.empty(n_queries, np.int64)
    state[-1] = trail.best[-1]
    for frame in range(n_queries - 1, 0, -1):
        state[frame - 1] = trail.before(np.array([frame]), state[frame : frame + 1])[0]
    reference = trail.places(state)
    return reference, window_means(*along(evidence, reference), sequence_length)


def lagged(trail: Trail, evidence: FloatArray, sequence_length: int) -> tuple[IntArray, FloatArray]:
    """Return where each frame lies on the best path that ends K - 1 frames later.

    The last frames' paths end where the drive does. Results are those of `whole`.
    """
    n_queries = len(trail.best)
    frames = np.arange(n_queries)
    at = np.minimum(frames + sequence_length - 1, n_queries - 1)
    state = trail.best[at]
    total, count = np.zeros(n_queries), np.zeros(n_queries)
    walking = frames
    while True:
        place = trail.places(state[walking])
        known = place >= 0
        total[walking] += np.where(known, evidence[at[walking], np.maximum(place, 0)], 0)
        count[walking] += known
        walking = walking[at[walking] > walking]
        if not len(walking):
            return trail.places(state), (total / np.maximum(count, 1)).astype(np.float32)
        state[walking] = trail.before(at[walking], state[walking])
        at[walking] -= 1


class LaggedSearch:
    """A path search at work frame by frame; it keeps K rows."""

    def __init__(self, search: PathSearch, weigh: RunningEvidence, sequence_length: int) -> None:
        self._search = search
        self._weigh = weigh
        self._length = sequence_length
        self._trails: deque[Trail] = deque(maxlen=sequence_length)
        self._evidence: deque[Array] = deque(maxlen=sequence_length)
        self._n_seen = 0

    def update(self, row: FloatArray) -> Answer | None:
        """See `OnlineMatcher.update`."""
        evidence = self._weigh.update(row)
        self._trails.append(self._search.advance(evidence))
        self._evidence.append(evidence)
        self._n_seen += 1
        return self._answers(1)[0] if self._n_seen >= self._length else None

    def finish(self) -> list[Answer]:
        """Return the answers of the last K - 1 frames, or of all where there were fewer."""
        kept = len(self._trails)
        first_owed = 1 if self._n_seen >= self._length else 0
        return self._answers(kept)[first_owed:] if kept else []

    def _answers(self, n_answers: int) -> list[Answer]:
        """Return the answers for the oldest frames kept."""
        trail = self._trails[0].join(list(self._trails))
        evidence = np.concatenate(list(self._evidence))
        reference, score = lagged(trail, evidence, self._length)
        first = self._n_seen - len(reference)
        return [
            Answer(first + i, int(reference[i]), float(score[i]), self._n_seen)
            for i in range(n_answers)
        ]
