"""Graph search: the best path through matching and hidden nodes of the data association graph."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.kernels import graph
from retraverse.matching.checks import check_lengths_fit, checked_similarity
from retraverse.matching.matchers.base import OnlineMatcher
from retraverse.matching.matchers.evidence import (
    EVIDENCE_HELP,
    EvidenceKind,
    RunningEvidence,
    drive_evidence,
    no_information,
    running_evidence,
)
from retraverse.matching.matchers.motion import moves_within
from retraverse.matching.matchers.registry import register
from retraverse.matching.matchers.trails import GraphTrail, LaggedSearch, lagged, whole
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import FloatArray

__all__ = ["Graph", "GraphParameters"]


@dataclass(frozen=True)
class GraphParameters:
    """Fan-out as the authors' program has it; costs in standard deviations of a row.

    The costs are set by chance alone: of a drive that is never on the map (normal random numbers,
    400 frames, maps of 100 to 3000), at most 3 frames in 100 are matched; with a hidden node worth
    1.5 it would be 30.
    """

    decode: Literal["lag", "whole"] = parameter(
        "lag", "the best path K - 1 frames later, or that of the whole drive"
    )
    fan_out: int = parameter(3, "frames of the map an edge may lead forward")
    back: int = parameter(1, "frames of the map an edge may lead back")
    non_matching: float = parameter(
        1.75,
        "what a hidden node is worth: pairs on the path must stand out more on average; the best "
        "path through pure chance reaches 1.45",
    )
    surface: float = parameter(
        5.0, "what it costs to come out of hiding, so that chance hits do not pay"
    )
    jump: float = parameter(10.0, "what it costs, in hiding, to go on anywhere on the map")
    evidence: EvidenceKind = parameter("balanced", EVIDENCE_HELP)

    def __post_init__(self) -> None:
        check_range("fan_out", self.fan_out, 1, 30)
        check_range("back", self.back, 0, 30)
        check_range("non_matching", self.non_matching, -5, 5)
        check_range("surface", self.surface, 0, 1000)
        check_range("jump", self.jump, 0, 1000)


@register(GraphParameters)
class Graph:
    """Shortest path in the spirit of lazy data association.

    Every pair is two nodes: a matching one worth the pair's evidence (see `evidence`), and a
    hidden one worth `non_matching`, taken where the camera has left the map or sees nothing it
    knows. Edges lead from each query frame to the next, `back` to `fan_out` map frames on, at no
    cost; the position goes on in hiding. The authors expand only the nodes that the shortest path
    needs; here a kernel passes all of them row by row, which finds the same path.

    Frames at hidden nodes are answered "no match". The score is the path's mean evidence over K
    frames. With ``decode="lag"`` each frame is answered when K - 1 more have come, from all frames
    so far; `sequence_length` counts them.
    """

    name: ClassVar[str] = "graph"
    summary: ClassVar[str] = "Best path through matching and non-matching nodes"
    citation: ClassVar[str] = (
        "Vysotska, Stachniss, Lazy data association for image sequences matching under "
        "substantial appearance changes, IEEE RA-L, 2016"
    )
    cost: ClassVar[str] = "O(Q R) for each edge of a node, whatever K; 6 more bytes a pair"
    assumes: ClassVar[str] = "-1 to 3 map frames per query frame; may leave the map and come back"
    frame_by_frame: ClassVar[bool] = True

    def __init__(self, parameters: GraphParameters | None = None) -> None:
        self.parameters = parameters or GraphParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        n_queries, n_references = scores.shape
        check_lengths_fit(n_queries, n_references, sequence_length)
        is_lagged = self.parameters.decode == "lag"
        weigh = running_evidence if is_lagged else drive_evidence
        evidence = weigh(scores, self.parameters.evidence)
        trail = GraphSearch(self.parameters).advance(evidence)
        reference, score = (lagged if is_lagged else whole)(trail, evidence, sequence_length)
        ahead = sequence_length if is_lagged else n_queries
        return Matches(
            query=np.arange(n_queries),
            reference=np.full_like(reference, NO_MATCH) if no_information(evidence) else reference,
            score=score,
            sequence_length=np.minimum(np.arange(n_queries) + ahead, n_queries),
            n_queries=n_queries,
            n_references=n_references,
        )

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """See `Matcher.online`: an answer comes K - 1 frames after its frame."""
        check_lengths_fit(sequence_length, n_references, sequence_length)
        if self.parameters.decode != "lag":
            raise ConfigError(
                f"graph with decode {self.parameters.decode!r} needs the whole drive; expected "
                "'lag' to run frame by frame"
            )
        evidence = RunningEvidence(n_references, self.parameters.evidence)
        return LaggedSearch(GraphSearch(self.parameters), evidence, sequence_length)


class GraphSearch:
    """The best paths so far, for `trails`."""

    def __init__(self, parameters: GraphParameters) -> None:
        self._parameters = parameters
        self._moves = moves_within(parameters.back, parameters.fan_out)
        self._state: FloatArray | None = None

    def advance(self, evidence: FloatArray) -> GraphTrail:
        """Take in rows of evidence and return their trail."""
        if self._state is None:
            # Every node of the first frame may be where the path begins: all alike before it.
            self._state = np.zeros((2, evidence.shape[1]), np.float32)
        rows = graph(
            evidence,
            self._moves,
            self._state,
            hidden=self._parameters.non_matching,
            surface=self._parameters.surface,
            jump=self._parameters.jump,
        )
        return GraphTrail(rows, self._moves)
