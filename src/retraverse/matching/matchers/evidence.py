"""Evidence: how far each pair stands out among the pairs of its query, habits taken out.

A row of similarities minus its mean, over its standard deviation. Whatever makes a whole picture
look more or less like everything (light, blur, a technique's own scale) falls out, so that rows
can be added up and compared with fixed thresholds.

Some references look like everything, too (see `retraverse.matching.balance`), and a path through
the matrix would settle on them. ``"balanced"`` evidence takes each reference's habit out: its mean
and deviation over the query drive, or over the frames so far where answers are due frame by frame.
`PRIOR_FRAMES` frames' worth of belief that it has none keep short drives sane. The rows are then
brought to the same scale again. ``"row"`` evidence needs nothing but the row.

An unmatched pair's evidence is roughly a standard normal number. The true pair's stands out by
some two of them for a technique worth using.
"""

import math
from typing import Literal

import numpy as np

from retraverse.matching.balance import PRIOR_FRAMES, RunningHabit
from retraverse.matching.checks import check_row
from retraverse.types import Array, BoolArray, FloatArray, IntArray

__all__ = [
    "EVIDENCE_HELP",
    "LARGEST",
    "EvidenceKind",
    "RunningEvidence",
    "along",
    "drive_evidence",
    "no_information",
    "running_evidence",
    "window_means",
]

EvidenceKind = Literal["balanced", "row"]
EVIDENCE_HELP = (
    "balanced: what a reference says of most queries is taken out; row: each query by itself"
)

LARGEST = 5.0
"""Evidence is cut off here on both sides, so that no single frame decides: more than 5 standard
deviations say no more than "certainly"."""
FLAT = 1e-6
"""A row that nowhere differs from its mean by more than this, relatively, is constant up to
rounding."""
SMALLEST = 1e-37
"""Differences below this are lost in float32."""


def drive_evidence(similarity: FloatArray, kind: EvidenceKind) -> FloatArray:
    """Return the evidence of every pair given the whole drive, float32 (Q, R).

    Constant rows say nothing: they are 0.
    """
    evidence = _standardise_rows(similarity, out=np.empty(similarity.shape, np.float32))
    if kind == "balanced":
        informed = evidence.any(axis=1)
        n_frames = len(evidence) + PRIOR_FRAMES
        mean = evidence.sum(axis=0, dtype=np.float64) / n_frames
        squares = np.einsum("qr,qr->r", evidence, evidence, dtype=np.float64)
        # At least PRIOR_FRAMES / n_frames, so never 0.
        variance = (squares + PRIOR_FRAMES) / n_frames - mean**2
        evidence -= mean.astype(np.float32)
        evidence *= (1 / np.sqrt(variance)).astype(np.float32)
        evidence[~informed] = 0
        _standardise_rows(evidence, out=evidence)
    return np.asarray(np.clip(evidence, -LARGEST, LARGEST, out=evidence))


def running_evidence(similarity: FloatArray, kind: EvidenceKind) -> FloatArray:
    """Return the evidence of every pair given the frames up to its own, float32 (Q, R)."""
    if kind == "row":
        return drive_evidence(similarity, kind)
    running = RunningEvidence(similarity.shape[1], kind)
    return np.concatenate([running.update(row) for row in similarity])


class RunningEvidence:
    """Evidence frame by frame: `running_evidence`, one row at a time."""

    def __init__(self, n_references: int, kind: EvidenceKind) -> None:
        self._n_references = n_references
        self._habit = RunningHabit(n_references) if kind == "balanced" else None

    def update(self, row: FloatArray) -> FloatArray:
        """Return the next frame's evidence, float32 (1, R); ShapeError for an unfit row."""
        checked = check_row(row, self._n_references)
        evidence = _standardise_rows(checked, out=np.empty(checked.shape, np.float32))
        if self._habit is not None:
            says_something = evidence.any()
            evidence[0] = self._habit.take_out(evidence[0])
            evidence *= says_something
            _standardise_rows(evidence, out=evidence)
        return np.asarray(np.clip(evidence, -LARGEST, LARGEST, out=evidence))


def no_information(evidence: FloatArray) -> bool:
    """Return whether no row says anything."""
    return not evidence.any()


def window_means(values: Array, counted: BoolArray, sequence_length: int) -> FloatArray:
    """Return float32 (N,): mean of the counted values among each one and the K - 1 after it.

    0 where none is counted; windows are cut off at the end.
    """
    sums = _window_sums(np.where(counted, values, 0).astype(np.float64), sequence_length)
    counts = _window_sums(counted.astype(np.float64), sequence_length)
    return np.asarray(sums / np.maximum(counts, 1), np.float32)


def along(evidence: FloatArray, reference: IntArray) -> tuple[Array, BoolArray]:
    """Return the evidence of each query's reference, and whether it has one (-1 = none)."""
    known = reference >= 0
    values: Array = evidence[np.arange(len(reference)), np.maximum(reference, 0)]
    return values, known


def _standardise_rows(values: FloatArray, *, out: FloatArray) -> FloatArray:
    """Write every row with mean 0 and deviation 1 to `out`; constant rows are 0."""
    for row, result in zip(values, out, strict=True):
        mean = row.mean(dtype=np.float64)
        np.subtract(row, np.float32(mean), out=result)
        largest = float(np.abs(result).max())
        if largest <= FLAT * abs(mean) + SMALLEST:
            result[:] = 0
            continue
        result *= np.float32(1 / largest)  # squares of any scale of scores then fit
        result *= np.float32(1 / math.sqrt(np.square(result).mean(dtype=np.float64)))
    return out


def _window_sums(values: Array, length: int) -> Array:
    running = np.concatenate([[0.0], np.cumsum(values)])
    ends = np.minimum(np.arange(len(values)) + length, len(values))
    return np.asarray(running[ends] - running[:-1])
