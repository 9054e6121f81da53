"""Dynamic time warping: one monotone path from the first query frame to the last."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.kernels import dtw_steps
from retraverse.matching.checks import check_lengths_fit, checked_similarity
from retraverse.matching.matchers.base import OnlineMatcher
from retraverse.matching.matchers.evidence import (
    EVIDENCE_HELP,
    EvidenceKind,
    along,
    drive_evidence,
    no_information,
    window_means,
)
from retraverse.matching.matchers.registry import register
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.techniques.parameters import parameter
from retraverse.types import Array, FloatArray, IntArray

__all__ = ["Dtw", "DtwParameters"]


@dataclass(frozen=True)
class DtwParameters:
    """How much of the map the query covers."""

    scope: Literal["local", "global"] = parameter(
        "local", "the query is some part of the map; or the whole of it, from end to end"
    )
    evidence: EvidenceKind = parameter("balanced", EVIDENCE_HELP)


@register(DtwParameters)
class Dtw:
    """Dynamic time warping of the whole query onto a part of the map, or all of it.

    A path steps to the next query frame, the next reference, or both, and pays for every pair it
    passes: how far the pair's evidence (see `evidence`) is below the best of its query. Among
    equal ways it takes the diagonal, then the same reference. ``local`` begins and ends at any
    reference (subsequence matching: Müller, Information retrieval for music and motion, 2007,
    section 4.4), ``global`` at the corners. Where a query frame passes several references, it
    belongs to the one with the most evidence.

    Every frame is answered, on the evidence of all; the score is the path's mean evidence over K
    frames. K has no part in the path.
    """

    name: ClassVar[str] = "dtw"
    summary: ClassVar[str] = "Dynamic time warping of the whole query, locally or globally"
    citation: ClassVar[str] = (
        "Sakoe, Chiba, Dynamic programming algorithm optimization for spoken word recognition, "
        "IEEE Transactions on Acoustics, Speech, and Signal Processing, 1978"
    )
    cost: ClassVar[str] = "O(Q R) whatever K; 9 more bytes a pair"
    assumes: ClassVar[str] = (
        "one unbroken run along the map, forward at any speed, stops allowed; no jumps, never off"
    )
    frame_by_frame: ClassVar[bool] = False

    def __init__(self, parameters: DtwParameters | None = None) -> None:
        self.parameters = parameters or DtwParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        n_queries, n_references = scores.shape
        check_lengths_fit(n_queries, n_references, sequence_length)
        evidence = drive_evidence(scores, self.parameters.evidence)
        if no_information(evidence):
            reference = np.full(n_queries, NO_MATCH)
        else:
            reference = self._path(evidence)
        return Matches(
            query=np.arange(n_queries),
            reference=reference,
            score=window_means(*along(evidence, reference), sequence_length),
            sequence_length=np.full(n_queries, n_queries),
            n_queries=n_queries,
            n_references=n_references,
        )

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """Raise `ConfigError`: the path is known when the drive has ended."""
        raise ConfigError("dtw needs the whole drive; expected mean, seqslam, hmm or graph")

    def _path(self, evidence: FloatArray) -> IntArray:
        costs = evidence.max(axis=1, keepdims=True) - evidence
        steps, end = dtw_steps(costs, open=self.parameters.scope == "local")
        reference = [
            first + int(row[first : last + 1].argmax())
            for row, (first, last) in zip(evidence, _runs(steps, end), strict=True)
        ]
        return np.array(reference, np.int64)


def _runs(steps: Array, end: int) -> list[tuple[int, int]]:
    """Return the first and last reference that the path passes at each query."""
    runs, query, reference, last = [], len(steps) - 1, end, end
    while True:
        step = steps[query, reference]
        if step == 2:
            reference -= 1
            continue
        runs.append((reference, last))
        if step == 3:
            # Where the path begins in the first row there is nothing before it.
            return runs[::-1]
        query -= 1
        reference -= int(step == 0)
        last = reference
