"""One task of a study: one technique on one pair of drives, by all matchers and lengths.

The similarity matrix is made once, or comes from the cache; every fixed length and every matcher
reads it. Windows of dynamic length, and those under the region of interest of their first frame,
need the descriptions too; they are answered together (`window_answers`).

Times: t_m of a window of K frames is K rows of similarity and the matching of one window: what an
answer costs that starts from nothing (equations 4.7 and 6.3), whatever the task's runs share.
"""

import math
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from retraverse.datasets import GroundTruth
from retraverse.maps import RouteMap
from retraverse.maps.contents import Contents
from retraverse.maps.frame_table import FrameTable
from retraverse.maps.segment import Segment
from retraverse.matching import (
    Matcher,
    Matches,
    SequenceLength,
    match_similarity,
    similarity,
)
from retraverse.matching.calibrated_length import with_entropy
from retraverse.matching.matchers import describe_matcher
from retraverse.matching.pairwise import has_descriptor
from retraverse.metrics import evaluate, t_vpr
from retraverse.studies.keeping.cache import CacheEntry
from retraverse.studies.keeping.records import RunRecord, Status
from retraverse.studies.plans.plan import MatcherChoice, TechniqueChoice
from retraverse.studies.tasks.describe_task import TIMES, made_technique, one_line_reason
from retraverse.studies.tasks.window_answers import Answers, answer_windows, timed_answers
from retraverse.techniques import Descriptions, Technique
from retraverse.techniques.handmade.regional_hog import RegionalHog
from retraverse.techniques.sending import Coding, Received, received
from retraverse.types import Array, FloatArray

__all__ = [
    "InHand",
    "MatchTask",
    "Matched",
    "RunSpec",
    "Source",
    "failed_runs",
    "in_hand",
    "is_readable",
    "match_task",
    "needs_descriptions",
]

KEPT_BYTES = 256 << 20
"""What a worker keeps of the drives it loaded last: one query is matched with many maps."""


class Source(Protocol):
    """Arrays that a task can load: in the cache, or sent along."""

    def load(self) -> Mapping[str, Array]:
        """Return them."""
        ...


@dataclass(frozen=True)
class InHand:
    """Arrays that are sent along."""

    arrays: Mapping[str, Array]

    def load(self) -> Mapping[str, Array]:
        """Return them."""
        return self.arrays


@dataclass(frozen=True)
class RunSpec:
    """One run of a task."""

    run_id: str
    matcher: MatcherChoice
    sequence_length: SequenceLength
    seed: int


@dataclass(frozen=True)
class MatchTask:
    """One technique on one pair of drives."""

    base: RunRecord
    """What all its records have in common."""
    technique: TechniqueChoice
    runs: tuple[RunSpec, ...]
    truth: GroundTruth
    matrix: Source | None
    """Where the similarity matrix is; None = it is to be made."""
    query: tuple[Source, ...] = ()
    """Descriptions of the query, piece by piece; empty where the matrix does."""
    reference: tuple[Source, ...] = ()
    """Descriptions of the map, piece by piece."""
    sent: Coding | None = None
    """How the query's descriptors come to where the map is; None = they are made there."""
    query_entropy: tuple[float, ...] = ()
    """Entropy of every query picture, for dynamic lengths; empty where none asks for it."""


@dataclass(frozen=True)
class Matched:
    """What a task found."""

    records: tuple[RunRecord, ...]
    matrix: Mapping[str, Array] | None
    """The cache entry of the matrix, if it was made here."""
    n_empty_roi: int = 0
    """Query pictures without a region of interest, if the matrix was made here."""


def is_readable(task: MatchTask) -> bool:
    """Return whether this process can read all that the task finds by path."""
    sources = (task.matrix, *task.query, *task.reference)
    return all(source.path.is_file() for source in sources if isinstance(source, CacheEntry))


def in_hand(task: MatchTask) -> MatchTask:
    """Return the task with everything sent along, for who does not see our files."""
    query, reference = (
        tuple(InHand(source.load()) for source in side) for side in (task.query, task.reference)
    )
    matrix = None if task.matrix is None else InHand(task.matrix.load())
    return replace(task, matrix=matrix, query=query, reference=reference)


def needs_descriptions(technique: TechniqueChoice, runs: Sequence[RunSpec]) -> bool:
    """Return whether some runs cannot do with the matrix alone."""
    return any(_goes_beyond_matrix(made_technique(technique), spec) for spec in runs)


def match_task(task: MatchTask) -> Matched:
    """Return the records of a task; a run that fails is a record that says why."""
    try:
        pair = _Pair(task)
    except Exception as error:
        return Matched(failed_runs(task.base, task.runs, one_line_reason(error)), None)
    records = []
    for spec in task.runs:
        try:
            records.append(_run(pair, spec))
        except Exception as error:
            records.extend(failed_runs(task.base, [spec], one_line_reason(error)))
    return Matched(tuple(records), pair.made, pair.n_empty_roi)


class _Pair:
    """Two described drives and their similarity matrix."""

    def __init__(self, task: MatchTask) -> None:
        self.task = task
        self.technique: Technique = made_technique(task.technique)
        self.made: dict[str, Array] | None = None
        self.n_empty_roi = 0
        self._route: RouteMap | None = None
        self._seen: Descriptions | None = None
        self._arrived: Received | None = None
        self._answers: dict[SequenceLength, Answers | Exception] | None = None
        if isinstance(self.technique, RegionalHog):
            # Whoever gives out the tasks says it once for all of them.
            self.technique.warns_of_empty_roi = False
        entry = self._make() if task.matrix is None else task.matrix.load()
        self.scores: FloatArray = entry["similarity"]
        self.row_s = float(entry["row_s"])
        self.encode_s = float(entry["encode_s"])
        # None in the matrices of pictures.
        self.coding_s = float(entry.get("coding_s", math.nan))
        self.no_descriptor_share = float(entry["no_descriptor_share"])
        self.no_descriptor = ~entry["has_descriptor"].astype(bool)

    @property
    def seen(self) -> Descriptions:
        """The query's descriptions where they are made, with entropy where it was sent."""
        if self._seen is None:
            self._seen = _gather(self.task.query).descriptions
            entropy = self.task.query_entropy
            if entropy and "entropy" not in self._seen.arrays:
                self._seen = with_entropy(self._seen, np.array(entropy))
        return self._seen

    @property
    def arrived(self) -> Received:
        """The query's descriptions where the map is."""
        if self._arrived is None:
            if self.task.sent is None:
                self._arrived = Received(self.seen, math.nan)
            else:
                known = self.route.descriptions()
                self._arrived = received(self.seen, known, self.task.sent)
        return self._arrived

    @property
    def route(self) -> RouteMap:
        """The map."""
        if self._route is None:
            self._route = _route(_gather(self.task.reference).descriptions, self.technique)
        return self._route

    def answers(self, length: SequenceLength) -> Answers:
        """Return the mean's answers by more than the matrix; all such lengths are found at once."""
        if self._answers is None:
            lengths = dict.fromkeys(
                spec.sequence_length
                for spec in self.task.runs
                if _goes_beyond_matrix(self.technique, spec)
            )
            arrived = self.arrived.descriptions
            self._answers = answer_windows(
                arrived, self.route, self.scores, lengths, lengths_by=self.seen
            )
        found = self._answers[length]
        if isinstance(found, Exception):
            raise found
        return found

    def _make(self) -> Mapping[str, Array]:
        queries, route = self.arrived.descriptions, self.route
        if not getattr(self.technique, "compares_whole_drives", False):
            self.technique.similarity(queries[:1], queries[:1])  # Warm up: not part of the time.
        began = time.perf_counter()
        scores = similarity(queries, route)
        row_s = (time.perf_counter() - began) / len(queries)
        described = has_descriptor(self.seen)
        if isinstance(self.technique, RegionalHog):
            self.n_empty_roi = int(self.technique.empty_roi(queries).sum())
        self.made = {
            "similarity": scores,
            "row_s": np.array(row_s),
            "encode_s": np.array(np.median(_gather(self.task.query).seconds)),
            "no_descriptor_share": np.array(1 - described.mean()),
            "has_descriptor": described,
        }
        if self.task.sent is not None:
            self.made["coding_s"] = np.array(self.arrived.frame_s)
        return self.made


def _run(pair: _Pair, spec: RunSpec) -> RunRecord:
    answers = _answers(pair, spec)
    matches = answers.matches
    evaluation = evaluate(matches, pair.task.truth, seed=spec.seed)
    length = evaluation.mean_sequence_length
    match_s = length * pair.row_s + answers.window_s
    describe_s = pair.encode_s + (0 if math.isnan(pair.coding_s) else pair.coding_s)
    return replace(
        _base(pair.task.base, spec),
        mean_sequence_length=length,
        n_windows=len(matches),
        n_candidates=_candidates(matches, spec.sequence_length),
        accuracy=evaluation.accuracy,
        accuracy_low=evaluation.accuracy_interval.low,
        accuracy_high=evaluation.accuracy_interval.high,
        auc=evaluation.auc,
        p_r100=evaluation.p_r100,
        r_p100=evaluation.r_p100,
        ep=evaluation.ep,
        no_descriptor_share=pair.no_descriptor_share,
        encode_s=pair.encode_s,
        match_s=match_s,
        vpr_s=t_vpr(describe_s, match_s, length) if length > 0 else math.nan,
        coding_s=pair.coding_s,
        sequence_lengths=(
            tuple(matches.sequence_length.tolist()) if spec.sequence_length == "dynamic" else ()
        ),
        answer_query=tuple(matches.query.tolist()),
        answer_reference=tuple(matches.reference.tolist()),
        answer_score=tuple(map(float, matches.score.tolist())),
        answer_correct=tuple(evaluation.correct.tolist()),
    )


def _answers(pair: _Pair, spec: RunSpec) -> Answers:
    if _goes_beyond_matrix(pair.technique, spec):
        return pair.answers(spec.sequence_length)
    return timed_answers(lambda: _match_matrix(pair, spec))


def _match_matrix(pair: _Pair, spec: RunSpec) -> Matches:
    length = int(spec.sequence_length)
    matches = match_similarity(pair.scores, sequence_length=length, matcher=_matcher(spec.matcher))
    if spec.matcher.name == "mean":
        # As `match` does: a window without any descriptor is answered "no match".
        nothing = np.convolve(~pair.no_descriptor, np.ones(length), "valid") == 0
        matches = matches.refuse(nothing)
    return matches


def _goes_beyond_matrix(technique: Technique, spec: RunSpec) -> bool:
    if spec.sequence_length == "dynamic":
        return True  # Plans ask for it by the mean only.
    follows_first = getattr(technique.parameters, "roi", "each") == "first"
    return follows_first and spec.matcher.name == "mean" and spec.sequence_length > 1


def _candidates(matches: Matches, length: SequenceLength) -> int:
    if length == "dynamic":
        return matches.n_references - int(matches.sequence_length.max(initial=1)) + 1
    return matches.n_references - int(length) + 1


def _base(base: RunRecord, spec: RunSpec) -> RunRecord:
    return replace(
        base,
        run_id=spec.run_id,
        matcher=describe_matcher(_matcher(spec.matcher)),
        sequence_length=str(spec.sequence_length),
        seed=spec.seed,
    )


def failed_runs(
    base: RunRecord, runs: Sequence[RunSpec], reason: str, status: Status = "failed"
) -> tuple[RunRecord, ...]:
    """Return the records of runs without a result."""
    without = replace(base, status=status, error=reason, similarity_key="")
    return tuple(_base(without, spec) for spec in runs)


@dataclass(frozen=True)
class _Described:
    """A drive's descriptions, and the seconds each took."""

    descriptions: Descriptions
    seconds: Array


_kept: OrderedDict[tuple[Source, ...], _Described] = OrderedDict()


def _gather(sources: tuple[Source, ...]) -> _Described:
    """Return the pieces of a drive as one; what lies in the cache is kept for the next task."""
    if not all(isinstance(source, CacheEntry) for source in sources):
        return _concatenate([source.load() for source in sources])
    if sources not in _kept:
        _kept[sources] = _concatenate([source.load() for source in sources])
    _kept.move_to_end(sources)
    while len(_kept) > 1 and sum(map(_n_bytes, _kept.values())) > KEPT_BYTES:
        _kept.popitem(last=False)
    return _kept[sources]


def _concatenate(pieces: Sequence[Mapping[str, Array]]) -> _Described:
    whole = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    seconds = whole.pop(TIMES)
    return _Described(Descriptions(whole), seconds)


def _n_bytes(described: _Described) -> int:
    return sum(array.nbytes for array in described.descriptions.arrays.values())


@lru_cache(maxsize=64)
def _made_matcher(name: str, parameters: tuple[tuple[str, Any], ...]) -> Matcher:
    return MatcherChoice(name, dict(parameters)).make()


def _matcher(choice: MatcherChoice) -> Matcher:
    """Return the matcher of a choice; looking it up takes longer than a short match."""
    return _made_matcher(choice.name, tuple(sorted(choice.parameters.items())))


def _route(descriptions: Descriptions, technique: Technique) -> RouteMap:
    """Return a map in memory of nothing but descriptions."""
    n_frames = len(descriptions)
    frames = FrameTable(
        ("",) * n_frames, np.arange(n_frames), np.full(n_frames, np.nan), position=None
    )
    segment = Segment(descriptions, frames, np.zeros((n_frames, 32), np.uint8), None)
    return RouteMap(technique, Contents((segment,), (), 0, None, None), None)
