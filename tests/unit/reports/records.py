"""Comparison records made up for the report's tests: noise with a diagonal, truth known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from retraverse.datasets import aligned
from retraverse.images import Frame
from retraverse.matching.matches import Matches
from retraverse.metrics import Evaluation, evaluate
from retraverse.studies.comparison_record import (
    ComparisonRecord,
    LengthPoint,
    Provenance,
    Times,
    TraverseRecord,
)
from retraverse.types import FloatArray

HOSTILE = "<script>window.hacked=1</script>\"'><img src=x onerror=window.hacked=2>&$x_{$.jpg"


def similarity(n_queries: int, n_references: int, *, seed: int = 3) -> FloatArray:
    """Return noise with a light diagonal; in every ninth row it is missing."""
    rng = np.random.default_rng(seed)
    scores = rng.uniform(0.1, 0.6, (n_queries, n_references)).astype(np.float32)
    for query in range(min(n_queries, n_references)):
        if query % 9 != 4:
            scores[query, query] += 0.35
    return scores


def best_windows(scores: FloatArray, lengths: Sequence[int]) -> Matches:
    """Match by the plain mean over each window's diagonal; windows past the end are left out."""
    n_queries, n_references = scores.shape
    rows = []
    for query, length in enumerate(lengths):
        if query + length <= n_queries and length <= n_references:
            n = n_references - length + 1
            means = sum(scores[query + t, t : t + n] for t in range(length)) / length
            rows.append((query, int(np.argmax(means)), float(np.max(means)), length))
    table = np.array(rows, np.float64).reshape(-1, 4)
    return Matches(
        query=table[:, 0].astype(np.int64),
        reference=table[:, 1].astype(np.int64),
        score=table[:, 2].astype(np.float32),
        sequence_length=table[:, 3].astype(np.int64),
        n_queries=n_queries,
        n_references=n_references,
    )


def make_record(
    n_queries: int = 40,
    n_references: int = 44,
    *,
    lengths: Sequence[int] | None = None,
    tolerance: int | None = 1,
    threshold: float | None = None,
    name: str = "frame_{}.jpg",
    notes: tuple[str, ...] = (),
) -> ComparisonRecord:
    """Return a record; `tolerance` None = no ground truth, `lengths` = K of each window."""
    scores = similarity(n_queries, n_references)
    lengths = [2 + query % 4 for query in range(n_queries)] if lengths is None else lengths
    matches = best_windows(scores, lengths)
    if threshold is not None:
        matches = matches.refuse_below(threshold)
    record = ComparisonRecord(
        reference=_traverse("summer", n_references, name),
        query=_traverse("winter", n_queries, name),
        similarity=scores,
        matches=matches,
        evaluation=None,
        single_frame=None,
        truth=None,
        lengths=(),
        descriptor_kind="regional",
        descriptor_dimension=30752,
        descriptor_bytes=123008,
        times=_times(matches),
        provenance=_provenance(lengths, threshold),
        notes=notes,
    )
    return record if tolerance is None else _judged(record, tolerance)


def _judged(record: ComparisonRecord, tolerance: int) -> ComparisonRecord:
    n_queries, n_references = record.similarity.shape
    truth = aligned(n_queries, n_references, tolerance=tolerance)
    small = record.similarity.size < 100_000

    def judged(lengths: Sequence[int]) -> Evaluation:
        matches = best_windows(record.similarity, lengths)
        return evaluate(matches, truth, n_resamples=20)

    points = []
    for length in (1, 2, 3, 5) if small else (1,):
        result = judged([length] * n_queries)
        n_candidates = max(n_references - length + 1, 0)
        point = LengthPoint(length, result.accuracy, result.auc, result.n_answered, n_candidates)
        points.append(point)
    return replace(
        record,
        truth=truth,
        evaluation=evaluate(
            record.matches,
            truth,
            similarity=record.similarity if small else None,
            n_resamples=20,
        ),
        single_frame=judged([1] * n_queries),
        lengths=tuple(points),
    )


def _traverse(name: str, n_frames: int, pattern: str) -> TraverseRecord:
    return TraverseRecord(
        name=name,
        source=f"drives/{name}",
        n_frames=n_frames,
        skipped=(("torn.jpg", "ends early"),) if name == "winter" else (),
        content_hash="sha256:" + "0123456789abcdef" * 4,
        sizes=((64, 48),),
        frame_names=tuple(pattern.replace("{}", str(number)) for number in range(n_frames)),
    )


def _times(matches: Matches) -> Times:
    mean = float(matches.sequence_length.mean()) if len(matches) else float("nan")
    return Times(
        encode_s=0.0061,
        read_s=0.002,
        match_s=0.0008,
        vpr_s=0.0061 * mean + 0.0008,
        mean_sequence_length=mean,
        total_s=3.2,
        threads=2,
        n_timed=40,
    )


def _provenance(lengths: Sequence[int], threshold: float | None) -> Provenance:
    fixed = len(set(lengths)) == 1
    return Provenance(
        version="0.1.0",
        created_at="2026-01-02T03:04:05+00:00",
        command="retraverse compare drives/summer drives/winter --aligned 1",
        technique="convsequential",
        technique_version=1,
        parameters={"roi": "first", "roi_entropy": 0.5},
        sequence_length=str(lengths[0]) if fixed else "dynamic",
        matcher="mean",
        threshold=threshold,
        kernel_backend="numpy",
        python="3.11.2",
        numpy="2.1.0",
        opencv="4.10.0",
        machine="x86-64, 2 cores, Linux",
        seed=0,
    )


def pictures(n: int, *, size: tuple[int, int] = (48, 64), noisy: bool = False) -> list[Frame]:
    """Return `n` frames, (height, width) each: a colour that changes along the drive, or noise."""
    rng = np.random.default_rng(5)

    def picture(number: int) -> Frame:
        pixels = np.zeros((*size, 3), np.uint8)
        if noisy:
            pixels[:] = rng.integers(0, 256, pixels.shape)
        else:
            pixels[:] = (number * 5 % 256, 120, 255 - number * 5 % 256)
        return Frame.from_array(pixels, index=number)

    if not noisy:
        return [picture(number) for number in range(n)]
    few = [picture(number) for number in range(20)]
    return [few[number % 20] for number in range(n)]
