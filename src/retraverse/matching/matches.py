"""The answer of matching: which reference each window of query frames belongs to."""

from dataclasses import dataclass, replace

import numpy as np

from retraverse.types import BoolArray, FloatArray, IntArray

__all__ = ["NO_MATCH", "Matches"]

NO_MATCH = -1
"""The reference of a window that was answered "no match"."""


@dataclass(frozen=True)
class Matches:
    """One answer per window of query frames; all arrays have one length, W.

    A window is named by one query frame, `query`, and answered by the reference frame that
    belongs to it. For the mean of the diagonal that is its *first* frame, for SeqSLAM's
    trajectories the middle one; matchers that follow a path answer for every frame. Queries that
    name no window (at the end of a drive, say) are not in `query` and count as unanswered;
    `frame_reference` and `by_frame` answer for them too, where a window reaches over them.
    """

    query: IntArray
    """(W,) query frame each window answers for, rising."""
    reference: IntArray
    """(W,) reference frame it belongs to; -1 = answered "no match"."""
    score: FloatArray
    """(W,) how good the match is, higher is better, also where refused: for the mean the mean
    similarity of the window's pairs; every other matcher says what it is."""
    sequence_length: IntArray
    """(W,) frames of evidence in each window, K."""
    n_queries: int
    """Frames in the query traverse."""
    n_references: int
    """Frames in the map."""
    notes: tuple[str, ...] = ()
    """What a reader must know to trust the answers, one sentence each."""
    followed: IntArray | None = None
    """(n_queries,) reference of every query frame, -1 = none, where the windows are no
    diagonals; None = each window goes on one reference per frame. See `frame_reference`."""

    def __len__(self) -> int:
        return len(self.query)

    @property
    def n_unanswered(self) -> int:
        """How many query frames name no window."""
        return self.n_queries - len(self)

    @property
    def is_match(self) -> BoolArray:
        """(W,) False where the answer was "no match"."""
        return np.asarray(self.reference != NO_MATCH)

    @property
    def are_diagonals(self) -> bool:
        """Whether every window runs from the frame it names, one reference per frame.

        So do those of the mean; lines of other speeds and paths through the drive do not.
        """
        within = self.query + self.sequence_length <= self.n_queries
        return self.followed is None and bool(within.all())

    @property
    def frame_reference(self) -> IntArray:
        """(n_queries,) the reference each query frame belongs to; -1 = none.

        A frame belongs to the window it names. One that names none follows the nearest window
        before it along that window's diagonal or trajectory (the first window, where none is
        before it), as far as the window reaches.
        """
        if self.followed is not None:
            return self.followed
        frames, window = np.arange(self.n_queries), self._window_of_frame()
        if not len(self):
            return np.full(self.n_queries, NO_MATCH, np.int64)
        ahead = frames - self.query[window]
        reference = self.reference[window] + ahead
        known = self.is_match[window] & (ahead >= 0) & (ahead < self.sequence_length[window])
        return np.where(known & (reference < self.n_references), reference, NO_MATCH)

    def by_frame(self) -> "Matches":
        """Return one answer for every query frame, so that all matchers answer the same frames.

        Reference by `frame_reference`; score and length are those of the frame's window.
        """
        window = self._window_of_frame()
        nothing = not len(self)
        return replace(
            self,
            query=np.arange(self.n_queries),
            reference=self.frame_reference,
            score=np.zeros(self.n_queries, np.float32) if nothing else self.score[window],
            sequence_length=(
                np.ones(self.n_queries, np.int64) if nothing else self.sequence_length[window]
            ),
            followed=self.frame_reference,
        )

    def refuse_below(self, threshold: float) -> "Matches":
        """Return the same answers with "no match" wherever the score is below `threshold`."""
        return self.refuse(self.score < np.float32(threshold))

    def refuse(self, windows: BoolArray) -> "Matches":
        """Return the same answers with "no match" for the windows marked True, shape (W,)."""
        followed = self.followed
        if followed is not None and len(self):
            followed = np.where(windows[self._window_of_frame()], NO_MATCH, followed)
        return replace(
            self, reference=np.where(windows, NO_MATCH, self.reference), followed=followed
        )

    def _window_of_frame(self) -> IntArray:
        """Return (n_queries,) the window each frame names, else the last one before, else 0."""
        window = np.searchsorted(self.query, np.arange(self.n_queries), side="right") - 1
        return np.maximum(window, 0)
