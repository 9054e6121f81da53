"""A study of one run: one drive located on another, with everything a report needs."""

import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np

from retraverse import kernels
from retraverse._version import __version__
from retraverse.datasets import GroundTruth
from retraverse.errors import InputError
from retraverse.images import Traverse
from retraverse.maps import build_map
from retraverse.matching import (
    Matcher,
    Matches,
    SequenceLength,
    describe_query,
    ensure_entropy,
    match,
    match_similarity,
    similarity,
)
from retraverse.matching.matchers import describe_matcher
from retraverse.metrics import Evaluation, evaluate, t_vpr
from retraverse.studies.comparison_record import (
    ComparisonRecord,
    LengthPoint,
    Provenance,
    Times,
    TraverseRecord,
)
from retraverse.techniques import Descriptions, FingerprintedTechnique, Technique
from retraverse.types import FloatArray, Progress, no_progress

__all__ = ["ComparePlan", "compare"]

LONGEST_LENGTH = 20
"""Fixed sequence lengths 1 to this are reported beside the chosen one (figures 3.9, 3.10)."""
N_TIMED = 12
"""Frames over which t_e is measured, one at a time on one thread."""
SEED = 0
"""Of the bootstrap intervals."""


@dataclass(frozen=True)
class ComparePlan:
    """What to compare by."""

    technique: Technique
    sequence_length: SequenceLength = "dynamic"
    matcher: str | Matcher = "mean"
    threshold: float | None = None
    command: str = ""
    """The command line that repeats the comparison, for the record."""


@dataclass
class _Stopwatch:
    """Wall-clock seconds of named stages."""

    seconds: dict[str, float] = field(default_factory=dict)
    _started: float = field(default_factory=time.perf_counter)

    def lap(self, stage: str) -> None:
        """Book the time since the last lap on `stage`."""
        now = time.perf_counter()
        self.seconds[stage] = now - self._started
        self._started = now


def compare(
    reference: Traverse,
    query: Traverse,
    plan: ComparePlan,
    truth: GroundTruth | None = None,
    *,
    progress: Progress = no_progress,
) -> ComparisonRecord:
    """Locate every window of `query` on `reference` and return all that was found.

    Parameters
    ----------
    reference, query : Traverse
        The earlier drive (the map) and the drive to locate.
    plan : ComparePlan
        Technique, sequence length, matcher, threshold.
    truth : GroundTruth, optional
        Without it the record has answers and scores, but no metrics.
    progress : Progress
        Watches describing and matching.

    Raises
    ------
    InputError
        If a traverse is shorter than a window, or the truth speaks of another number of frames.
    """
    _check_truth(truth, query, reference)
    watch = _Stopwatch()
    route = build_map(reference, plan.technique, progress=progress)
    queries = describe_query(query, route, progress=progress)
    if plan.sequence_length == "dynamic":
        queries = ensure_entropy(queries, query, progress=progress)
    watch.lap("describe")
    matches = match(
        queries,
        route,
        sequence_length=plan.sequence_length,
        matcher=plan.matcher,
        threshold=plan.threshold,
        progress=progress,
    )
    watch.lap("match")
    scores = similarity(queries, route, progress=progress)
    watch.lap("similarity")
    return ComparisonRecord(
        reference=_traverse_record(reference, progress),
        query=_traverse_record(query, progress),
        similarity=scores,
        matches=matches,
        evaluation=None if truth is None else evaluate(matches, truth, similarity=scores),
        single_frame=_evaluate_length(scores, truth, 1),
        truth=truth,
        lengths=_length_points(scores, truth),
        descriptor_kind=plan.technique.layout.kind,
        descriptor_dimension=plan.technique.layout.dimension,
        descriptor_bytes=plan.technique.layout.descriptor.n_bytes,
        times=_times(query, plan.technique, matches, watch),
        provenance=_provenance(plan),
        notes=_notes(matches, queries, plan, reference, query),
    )


def _check_truth(truth: GroundTruth | None, query: Traverse, reference: Traverse) -> None:
    if truth is None:
        return
    if truth.n_queries != len(query):
        raise InputError(
            f"ground truth: got {truth.n_queries} queries, expected {len(query)} "
            f"(frames in {query.name}); is it the truth of another drive?"
        )
    if truth.n_references not in (None, len(reference)):
        raise InputError(
            f"ground truth: got {truth.n_references} references, expected {len(reference)} "
            f"(frames in {reference.name}); is it the truth of another map?"
        )


def _evaluate_length(
    scores: FloatArray, truth: GroundTruth | None, sequence_length: int
) -> Evaluation | None:
    if truth is None:
        return None
    return evaluate(match_similarity(scores, sequence_length=sequence_length), truth)


def _length_points(scores: FloatArray, truth: GroundTruth | None) -> tuple[LengthPoint, ...]:
    """Return the result of every fixed length from the one matrix."""
    if truth is None:
        return ()
    points = []
    for length in range(1, min(LONGEST_LENGTH, *scores.shape) + 1):
        evaluation = _evaluate_length(scores, truth, length)
        assert evaluation is not None
        points.append(
            LengthPoint(
                sequence_length=length,
                accuracy=evaluation.accuracy,
                auc=evaluation.auc,
                n_windows=scores.shape[0] - length + 1,
                n_candidates=scores.shape[1] - length + 1,
            )
        )
    return tuple(points)


def _traverse_record(traverse: Traverse, progress: Progress) -> TraverseRecord:
    return TraverseRecord(
        name=traverse.name,
        source=traverse.source,
        n_frames=len(traverse),
        skipped=tuple((frame.name, frame.reason) for frame in traverse.skipped),
        content_hash=traverse.content_hash(progress),
        sizes=tuple(sorted({traverse[row].size[::-1] for row in _sample(len(traverse))})),
        frame_names=tuple(frame.name for frame in traverse),
    )


def _sample(n_frames: int) -> list[int]:
    """Return up to `N_TIMED` frame numbers spread over a traverse."""
    rows = np.linspace(0, n_frames - 1, min(N_TIMED, n_frames))
    return sorted({int(row) for row in rows})


def _times(query: Traverse, technique: Technique, matches: Matches, watch: _Stopwatch) -> Times:
    """Return the run's times; t_e is measured afresh, frame by frame, on this one thread."""
    rows = _sample(len(query))
    read_s, encode_s = [], []
    for row in rows:
        started = time.perf_counter()
        image = technique.read(query[row])
        read = time.perf_counter()
        technique.describe(image)
        read_s.append(read - started)
        encode_s.append(time.perf_counter() - read)
    mean_length = float(matches.sequence_length.mean())
    match_s = watch.seconds["match"] / len(matches)
    return Times(
        encode_s=float(np.median(encode_s)),
        read_s=float(np.median(read_s)),
        match_s=match_s,
        vpr_s=t_vpr(float(np.median(encode_s)), match_s, mean_length),
        mean_sequence_length=mean_length,
        total_s=watch.seconds["describe"] + watch.seconds["match"],
        threads=kernels.default_threads(),
        n_timed=len(rows),
    )


def _provenance(plan: ComparePlan) -> Provenance:
    import cv2

    return Provenance(
        version=__version__,
        created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        command=plan.command,
        technique=plan.technique.name,
        technique_version=plan.technique.version,
        parameters=_parameters(plan.technique),
        sequence_length=str(plan.sequence_length),
        matcher=_matcher_text(plan.matcher),
        threshold=plan.threshold,
        kernel_backend=kernels.backend(),
        python=platform.python_version(),
        numpy=np.__version__,
        opencv=cv2.__version__,
        machine=f"{platform.machine()}, {platform.system()}",
        seed=SEED,
        weights=_weights(plan.technique),
    )


def _weights(technique: Technique) -> str:
    """Return the fingerprint of a technique's trained weights, "" if it has none."""
    return technique.fingerprint() if isinstance(technique, FingerprintedTechnique) else ""


def _matcher_text(matcher: str | Matcher) -> str:
    return matcher if isinstance(matcher, str) else describe_matcher(matcher)


def _parameters(technique: Technique) -> Mapping[str, Any]:
    from dataclasses import asdict

    return asdict(technique.parameters)


def _notes(
    matches: Matches,
    queries: Descriptions,
    plan: ComparePlan,
    reference: Traverse,
    query: Traverse,
) -> tuple[str, ...]:
    """Return what a reader must know to trust the numbers, one sentence each."""
    notes = list(matches.notes)
    takes_mean = _matcher_text(plan.matcher) == "mean"
    if matches.n_unanswered:
        name = "start" if takes_mean else "are the middle of"
        ends = "the windows end where the drive ends" if takes_mean else "windows need both sides"
        notes.append(
            f"{matches.n_unanswered} of {matches.n_queries} query frames {name} no window and got "
            f"no answer: {ends}."
        )
    n_refused = int((~matches.is_match).sum())
    if n_refused:
        notes.append(f"{n_refused} windows were answered “no match”.")
    for traverse in (reference, query):
        if traverse.skipped:
            notes.append(
                f"{len(traverse.skipped)} pictures of {traverse.name} could not be read "
                "and were left out."
            )
    if takes_mean and getattr(plan.technique.parameters, "roi", "each") == "first":
        notes.append(
            "Windows take the region of interest of their first frame; the similarity matrix and "
            "the results at fixed lengths take each frame's own."
        )
    return tuple(notes)
