"""The answer of matching: which reference each window of query frames belongs to."""

from dataclasses import dataclass

import numpy as np

from retraverse.types import BoolArray, FloatArray, IntArray

__all__ = ["NO_MATCH", "Matches"]

NO_MATCH = -1
"""The reference of a window that was answered "no match"."""


@dataclass(frozen=True)
class Matches:
    """One answer per window of query frames; all arrays have one length, W.

    A window is named by its *first* query frame and answered by the *first* reference frame of
    its best match. Queries at the end of a drive may start no window: they are not in `query`
    and count as unanswered.
    """

    query: IntArray
    """(W,) first query frame of each window, rising."""
    reference: IntArray
    """(W,) first reference frame of its best match; -1 = answered "no match"."""
    score: FloatArray
    """(W,) mean similarity of the window's pairs at its best reference, also where refused."""
    sequence_length: IntArray
    """(W,) frames in each window, K."""
    n_queries: int
    """Frames in the query traverse."""
    n_references: int
    """Frames in the map."""

    def __len__(self) -> int:
        return len(self.query)

    @property
    def n_unanswered(self) -> int:
        """How many query frames start no window."""
        return self.n_queries - len(self)

    @property
    def is_match(self) -> BoolArray:
        """(W,) False where the answer was "no match"."""
        return np.asarray(self.reference != NO_MATCH)

    def refuse_below(self, threshold: float) -> "Matches":
        """Return the same answers with "no match" wherever the score is below `threshold`."""
        return self.refuse(self.score < np.float32(threshold))

    def refuse(self, windows: BoolArray) -> "Matches":
        """Return the same answers with "no match" for the windows marked True, shape (W,)."""
        return Matches(
            query=self.query,
            reference=np.where(windows, NO_MATCH, self.reference),
            score=self.score,
            sequence_length=self.sequence_length,
            n_queries=self.n_queries,
            n_references=self.n_references,
        )
