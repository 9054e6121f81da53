"""The mean of the diagonal over a balanced matrix: places that look like everything held back."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.matching.balance import RunningBalance, balance
from retraverse.matching.checks import check_lengths_fit, check_row, checked_similarity
from retraverse.matching.matchers.base import Answer
from retraverse.matching.matchers.mean import Mean, OnlineMean
from retraverse.matching.matchers.registry import register
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.techniques.parameters import parameter
from retraverse.types import FloatArray

__all__ = ["Balanced", "BalancedParameters"]


@dataclass(frozen=True)
class BalancedParameters:
    """How much of the drive a reference's habit is read from."""

    over: Literal["past", "drive"] = parameter(
        "past", "past: the frames so far, as a robot has them; drive: the whole drive, offline"
    )


@register(BalancedParameters)
class Balanced:
    """Mean of the diagonal after every reference's habit has been taken out, without labels.

    See `retraverse.matching.balance`. Scores are means of standard deviations above what each
    reference says of most queries. Windows, references and ties are those of `Mean`; a matrix whose
    rows are constant is answered "no match".
    """

    name: ClassVar[str] = "balanced"
    summary: ClassVar[str] = "Mean of the diagonal, places that look like everything held back"
    citation: ClassVar[str] = "This project, 2026; the mean: Tomiță et al., IEEE Access, 2021"
    cost: ClassVar[str] = "O(Q R) whatever K; one more matrix in memory"
    assumes: ClassVar[str] = "the map's speed, every frame on the map, and no long stops"
    frame_by_frame: ClassVar[bool] = True

    def __init__(self, parameters: BalancedParameters | None = None) -> None:
        self.parameters = parameters or BalancedParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        n_queries, n_references = scores.shape
        check_lengths_fit(n_queries, n_references, sequence_length)
        matches = Mean().match(self._balanced(scores), sequence_length)
        says_nothing = np.ptp(scores, axis=1).max(initial=0) == 0
        return matches.refuse(np.full(len(matches), says_nothing))

    def online(self, n_references: int, sequence_length: int) -> "OnlineBalanced":
        """See `Matcher.online`; offered where only the past is looked at."""
        if self.parameters.over != "past":
            raise ConfigError(
                "matcher balanced: over='drive' needs the whole drive; expected over='past'"
            )
        return OnlineBalanced(n_references, sequence_length)

    def _balanced(self, scores: FloatArray) -> FloatArray:
        if self.parameters.over == "drive" and len(scores) > 1:
            return balance(scores)
        running = RunningBalance(scores.shape[1])
        return np.stack([running.update(row) for row in scores])


class OnlineBalanced:
    """A running balance before a running mean: O(R) a frame."""

    def __init__(self, n_references: int, sequence_length: int) -> None:
        self._n_references = n_references
        self._balance = RunningBalance(n_references)
        self._mean: OnlineMean = Mean().online(n_references, sequence_length)
        self._says_something = False

    def update(self, row: FloatArray) -> Answer | None:
        """See `OnlineMatcher.update`."""
        scores = check_row(row, self._n_references)[0]
        self._says_something |= bool(np.ptp(scores) > 0)
        answer = self._mean.update(self._balance.update(scores))
        if answer is None or self._says_something:
            return answer
        return replace(answer, reference=NO_MATCH)

    def finish(self) -> list[Answer]:
        """Return none: every window was answered when its last frame came."""
        return []
