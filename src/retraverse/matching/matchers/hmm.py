"""A hidden Markov model: where the camera is, given how it may move; or that it is nowhere."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.kernels import Motion, ViterbiRows, backward, forward, viterbi
from retraverse.matching.checks import check_lengths_fit, checked_similarity
from retraverse.matching.matchers.base import Answer, OnlineMatcher
from retraverse.matching.matchers.evidence import (
    EVIDENCE_HELP,
    EvidenceKind,
    RunningEvidence,
    drive_evidence,
    running_evidence,
)
from retraverse.matching.matchers.motion import motion_model
from retraverse.matching.matchers.registry import register
from retraverse.matching.matchers.trails import LaggedSearch, ViterbiTrail, lagged, whole
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import FloatArray, IntArray

__all__ = ["Hmm", "HmmParameters"]

BLOCK_ROWS = 256
"""Rows whose likelihood is held at once."""
PRIOR_OUTSIDE = 0.5
"""Before the first frame nothing is known, not even whether the camera is on the map."""


@dataclass(frozen=True)
class HmmParameters:
    """Reasoned, not fitted: see each one's help."""

    decode: Literal["filter", "lag", "viterbi", "smooth"] = parameter(
        "filter",
        "from the frames so far; the likeliest path K - 1 frames later; of the whole drive; or "
        "each frame's own posterior given the whole drive",
    )
    back: int = parameter(1, "frames of the map it may move back from one query frame to the next")
    forward: int = parameter(3, "frames it may move forward: twice the map's speed and some slack")
    separation: float = parameter(
        2.0, "standard deviations by which the true pair stands out of its row"
    )
    jump: float = parameter(1e-3, "probability of going on anywhere else on the map")
    leave: float = parameter(1e-2, "probability of leaving the map")
    enter: float = parameter(1e-2, "probability, off the map, of coming (back) to it anywhere")
    evidence: EvidenceKind = parameter("balanced", EVIDENCE_HELP)

    def __post_init__(self) -> None:
        check_range("back", self.back, 0, 30)
        check_range("forward", self.forward, 1, 30)
        check_range("separation", self.separation, 0.01, 10)
        for name in ("jump", "leave", "enter"):
            check_range(name, getattr(self, name), 1e-12, 0.4)

    @property
    def needs_drive(self) -> bool:
        """Whether no frame is answered before the drive has ended."""
        return self.decode in ("viterbi", "smooth")


@register(HmmParameters)
class Hmm:
    """Hidden Markov model over the map's frames and one state more, "not in the map".

    A pair's evidence z (see `evidence`) is normal with mean 0 for unmatched pairs and mean
    `separation` for true ones, both with deviation 1; so the likelihood of a place, relative to
    being off the map, is ``exp(separation * z - separation^2 / 2)``. Moves are those of a camera at
    anything from half to twice the map's speed (`motion`).

    ``filter`` and ``smooth`` answer the likeliest reference if the camera is more probably near it
    (within the longest move) than off the map; the score is that probability. ``lag`` and
    ``viterbi`` answer where the likeliest path is; the score is the path's mean evidence over K
    frames. K plays no part in filter and smooth beyond that both drives need so many frames.

    Evidence counted in `sequence_length`: all frames up to the answered one (filter), up to
    K - 1 after it (lag), all (viterbi, smooth).
    """

    name: ClassVar[str] = "hmm"
    summary: ClassVar[str] = "Hidden Markov model with moves, stops, jumps, and “not in the map”"
    citation: ClassVar[str] = (
        "Rabiner, A tutorial on hidden Markov models and selected applications in speech "
        "recognition, Proceedings of the IEEE, 1989"
    )
    cost: ClassVar[str] = "O(Q R) for each move within reach, whatever K; up to two more matrices"
    assumes: ClassVar[str] = "moves of -1 to 3 map frames per query frame; jumps and absences rare"
    frame_by_frame: ClassVar[bool] = True

    def __init__(self, parameters: HmmParameters | None = None) -> None:
        self.parameters = parameters or HmmParameters()

    @property
    def motion(self) -> Motion:
        """The motion model of these parameters."""
        p = self.parameters
        return motion_model(p.back, p.forward, jump=p.jump, leave=p.leave, enter=p.enter)

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        n_queries, n_references = scores.shape
        check_lengths_fit(n_queries, n_references, sequence_length)
        weigh = drive_evidence if self.parameters.needs_drive else running_evidence
        evidence = weigh(scores, self.parameters.evidence)
        decode = self.parameters.decode
        if decode in ("filter", "smooth"):
            reference, score = self._decode_beliefs(evidence, smooth=decode == "smooth")
        else:
            follow = whole if decode == "viterbi" else lagged
            trail = ViterbiSearch(self).advance(evidence)
            reference, score = follow(trail, evidence, sequence_length)
        ahead = {"filter": 1, "lag": sequence_length, "viterbi": n_queries, "smooth": n_queries}
        return Matches(
            query=np.arange(n_queries),
            reference=reference,
            score=score,
            sequence_length=np.minimum(np.arange(n_queries) + ahead[decode], n_queries),
            n_queries=n_queries,
            n_references=n_references,
        )

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """See `Matcher.online`: filter answers at once, lag K - 1 frames later."""
        check_lengths_fit(sequence_length, n_references, sequence_length)
        if self.parameters.decode == "filter":
            return OnlineFilter(self, n_references)
        if self.parameters.decode == "lag":
            evidence = RunningEvidence(n_references, self.parameters.evidence)
            return LaggedSearch(ViterbiSearch(self), evidence, sequence_length)
        raise ConfigError(
            f"hmm with decode {self.parameters.decode!r} needs the whole drive; expected 'filter' "
            "or 'lag' to run frame by frame"
        )

    def log_likelihood(self, evidence: FloatArray) -> FloatArray:
        """Return log likelihoods of the places, relative to being off the map."""
        separation = np.float32(self.parameters.separation)
        return separation * evidence - separation * separation / 2

    def prior(self, n_references: int) -> FloatArray:
        """Return the belief before the first frame, float32 (R + 1,)."""
        belief = np.full(n_references + 1, (1 - PRIOR_OUTSIDE) / n_references, np.float32)
        belief[-1] = PRIOR_OUTSIDE
        return belief

    def filter_rows(self, evidence: FloatArray, belief: FloatArray, *, first: bool) -> FloatArray:
        """Return the beliefs after each row, float32 (B, R + 1); `belief` becomes the last."""
        likelihood = np.exp(self.log_likelihood(evidence))
        if not first:
            return forward(likelihood, self.motion, belief)
        belief[:-1] *= likelihood[0]
        belief /= belief.sum(dtype=np.float64)
        start = belief[None].copy()
        if len(evidence) == 1:
            return start
        return np.concatenate([start, forward(likelihood[1:], self.motion, belief)])

    def decide(self, beliefs: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the answer each belief gives, and the probability of being near it."""
        places = beliefs[:, :-1]
        best = places.argmax(axis=1)
        reach = max(self.parameters.back, self.parameters.forward)
        near = best[:, None] + np.arange(-reach, reach + 1)
        on_map = (near >= 0) & (near < places.shape[1])
        mass = np.take_along_axis(places, np.where(on_map, near, 0), axis=1)
        probability = np.where(on_map, mass, 0).sum(axis=1)
        return np.where(probability > beliefs[:, -1], best, NO_MATCH), probability

    def _decode_beliefs(self, evidence: FloatArray, *, smooth: bool) -> tuple[IntArray, FloatArray]:
        belief = self.prior(evidence.shape[1])
        answers, kept = [], []
        for start in range(0, len(evidence), BLOCK_ROWS):
            rows = evidence[start : start + BLOCK_ROWS]
            beliefs = self.filter_rows(rows, belief, first=start == 0)
            if smooth:
                kept.append(beliefs)
            else:
                answers.append(self.decide(beliefs))
        if smooth:
            answers = self._smooth(evidence, kept)
        reference, score = zip(*answers, strict=True)
        return np.concatenate(reference), np.concatenate(score)

    def _smooth(
        self, evidence: FloatArray, beliefs: list[FloatArray]
    ) -> list[tuple[IntArray, FloatArray]]:
        """Return the decisions that take later frames into account, block by block."""
        n_states = evidence.shape[1] + 1
        message = np.full(n_states, 1 / n_states, np.float32)
        answers = []
        for block in reversed(range(len(beliefs))):
            # The message at a frame comes through the likelihood of the next one.
            start = block * BLOCK_ROWS + 1
            later = evidence[start : start + len(beliefs[block])]
            messages = self._messages(later, message, len(beliefs[block]))
            joint = beliefs[block] * messages
            joint /= joint.sum(axis=1, dtype=np.float64, keepdims=True).astype(np.float32)
            answers.append(self.decide(joint))
        return answers[::-1]

    def _messages(self, later: FloatArray, message: FloatArray, n_rows: int) -> FloatArray:
        """Return what later frames say at each of `n_rows` frames; `message` moves to the first.

        `later` begins one frame after them; the drive's last frame has none after it.
        """
        if not len(later):
            return message[None].copy()
        at_later = backward(np.exp(self.log_likelihood(later)), self.motion, message)
        return np.concatenate([message[None], at_later])[:n_rows]


class ViterbiSearch:
    """The likeliest paths so far, for `trails`."""

    def __init__(self, hmm: Hmm) -> None:
        self._hmm = hmm
        self._state: FloatArray | None = None

    def advance(self, evidence: FloatArray) -> ViterbiTrail:
        """Take in rows of evidence and return their trail."""
        motion, trails = self._hmm.motion, []
        for start in range(0, len(evidence), BLOCK_ROWS):
            rows = self._hmm.log_likelihood(evidence[start : start + BLOCK_ROWS])
            if self._state is None:
                trails.append(ViterbiTrail(self._start(rows[0]), motion.moves))
                rows = rows[1:]
            if len(rows):
                assert self._state is not None
                trails.append(ViterbiTrail(viterbi(rows, motion, self._state), motion.moves))
        return trails[0].join(trails)

    def _start(self, row: FloatArray) -> ViterbiRows:
        """Weigh the first frame; nothing came before it."""
        n = len(row)
        state = np.log(self._hmm.prior(n))
        state[:-1] += row
        state -= state.max()
        self._state = state
        best = int(state[:-1].argmax())
        return ViterbiRows(
            pointers=np.zeros((1, n), np.uint8),
            peaks=np.zeros(1, np.int64),
            outside_from=np.full(1, NO_MATCH),
            best=np.array([NO_MATCH if state[-1] >= state[best] else best]),
        )


class OnlineFilter:
    """The filter at work: one belief is all it keeps."""

    def __init__(self, hmm: Hmm, n_references: int) -> None:
        self._hmm = hmm
        self._evidence = RunningEvidence(n_references, hmm.parameters.evidence)
        self._belief = hmm.prior(n_references)
        self._n_seen = 0

    def update(self, row: FloatArray) -> Answer:
        """See `OnlineMatcher.update`; every frame has an answer at once."""
        evidence = self._evidence.update(row)
        beliefs = self._hmm.filter_rows(evidence, self._belief, first=self._n_seen == 0)
        reference, score = self._hmm.decide(beliefs)
        self._n_seen += 1
        return Answer(self._n_seen - 1, int(reference[0]), float(score[0]), self._n_seen)

    def finish(self) -> list[Answer]:
        """Return none: every frame was answered when it came."""
        return []
