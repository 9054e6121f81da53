"""What one comparison of two traverses found: everything its report draws from.

A record holds results, never instructions: the study fills it once, and reports
only lay it out. All of it is plain numbers, text and arrays, so that a report can be
written again from a stored record.

Conventions
- ``similarity[query, reference]``: rows are queries, higher is better.
- Seconds are wall-clock seconds; frame numbers count from 0 in the frames that were read.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from retraverse.datasets import GroundTruth
from retraverse.matching.matches import Matches
from retraverse.metrics import Evaluation
from retraverse.types import FloatArray

__all__ = ["ComparisonRecord", "LengthPoint", "Provenance", "Times", "TraverseRecord"]


@dataclass(frozen=True)
class TraverseRecord:
    """One traverse as it was read."""

    name: str
    """Short name: the folder's or the film's."""
    source: str
    """Where it was read from, as the user gave it."""
    n_frames: int
    """Frames read and used."""
    skipped: tuple[tuple[str, str], ...]
    """Frames left out: (name, reason) each."""
    content_hash: str
    """Hash of all frames' bytes, in order."""
    sizes: tuple[tuple[int, int], ...]
    """The distinct picture sizes, (width, height) in pixels, among up to 12 frames."""
    frame_names: tuple[str, ...]
    """The frames' names, length `n_frames`."""


@dataclass(frozen=True)
class Times:
    """What the comparison cost, in wall-clock seconds on the machine of its provenance."""

    encode_s: float
    """t_e: describing one frame on one thread, reading not counted."""
    read_s: float
    """Reading and decoding one frame."""
    match_s: float
    """t_m: matching one query window against the whole map."""
    vpr_s: float
    """t_VPR = t_e * K + t_m, with K the mean sequence length."""
    mean_sequence_length: float
    """K: frames in a window, mean over all windows."""
    total_s: float
    """The whole comparison, from files to matches."""
    threads: int
    """Threads the whole run was allowed."""
    n_timed: int
    """Frames over which t_e was measured."""


@dataclass(frozen=True)
class LengthPoint:
    """The result at one fixed sequence length, from the same similarity matrix."""

    sequence_length: int
    """K, frames in every window."""
    accuracy: float
    """Correct windows / windows, in [0, 1]."""
    auc: float
    """Area under the PR curve (the definition of the record's evaluation), in [0, 1]."""
    n_windows: int
    """Query windows: N - K + 1."""
    n_candidates: int
    """Reference windows each of them could take: R - K + 1."""


@dataclass(frozen=True)
class Provenance:
    """What it takes to repeat the comparison."""

    version: str
    """Version of this package."""
    created_at: str
    """Date and time, ISO 8601 with time zone."""
    command: str
    """The command line that repeats it."""
    technique: str
    """Name of the technique."""
    technique_version: int
    """Version of its descriptions."""
    parameters: Mapping[str, Any]
    """Every parameter of the technique, defaults included."""
    sequence_length: str
    """``"dynamic"`` or the fixed K, as text."""
    matcher: str
    """Name of the sequence matcher, with the parameters that are not at their defaults."""
    threshold: float | None
    """Scores below it are answered "no match"; None = every window gets its best."""
    kernel_backend: str
    """``"native"`` or ``"numpy"``."""
    python: str
    """Version of Python."""
    numpy: str
    """Version of NumPy."""
    opencv: str
    """Version of OpenCV."""
    machine: str
    """Processor and operating system."""
    seed: int
    """Seed of every random choice."""
    weights: str = ""
    """SHA-256 of the technique's trained weights, whatever they are called; "" if it has none."""


@dataclass(frozen=True)
class ComparisonRecord:
    """One query traverse matched with one reference traverse."""

    reference: TraverseRecord
    """The map."""
    query: TraverseRecord
    """The drive that was located on it."""
    similarity: FloatArray
    """Single-frame scores, float32 (Q, R)."""
    matches: Matches
    """The answers, one per window."""
    evaluation: Evaluation | None
    """Metrics of `matches`; None without ground truth."""
    single_frame: Evaluation | None
    """Metrics of the same matrix at K = 1, to compare with; None without ground truth."""
    truth: GroundTruth | None
    """Which pairs are true matches; None if that is not known."""
    lengths: tuple[LengthPoint, ...]
    """Results at fixed sequence lengths, shortest first; empty without ground truth."""
    descriptor_kind: str
    """``"global"`` or ``"regional"``."""
    descriptor_dimension: int
    """Numbers in one frame's descriptor."""
    descriptor_bytes: int
    """Bytes one frame's descriptor takes in the map."""
    times: Times
    """What it cost."""
    provenance: Provenance
    """How to repeat it."""
    notes: tuple[str, ...]
    """What a reader must know: unanswered frames, fallbacks, warnings; one sentence each."""

    def margins(self, *, apart: int = 10) -> FloatArray:
        """Return how far each answer stands out from its best rival, shape (W,).

        The answer's mean single-frame score over its window less the best mean of any reference
        window that starts more than `apart` frames (or K, where that is more) from it; where the
        answer was "no match", the best window takes the answer's place. About 0: another place
        looks as good. NaN where the map is too short to have a rival, and for all answers that are
        not of diagonals (`Matches.are_diagonals`). Matchers that weigh a window's frames
        differently may prefer an answer of negative margin.
        """
        if not self.matches.are_diagonals:
            return np.full(len(self.matches), np.nan, np.float32)
        margins = [
            self._margin(int(query), int(reference), int(length), apart)
            for query, reference, length in zip(
                self.matches.query,
                self.matches.reference,
                self.matches.sequence_length,
                strict=True,
            )
        ]
        return np.asarray(margins, np.float32)

    def _margin(self, query: int, reference: int, length: int, apart: int) -> float:
        n_candidates = self.similarity.shape[1] - length + 1
        means = np.zeros(max(n_candidates, 0))
        for step in range(length):
            means += self.similarity[query + step, step : step + len(means)]
        means /= length
        if not len(means):
            return float("nan")
        answer = reference if 0 <= reference < len(means) else int(means.argmax())
        rivals = means[np.abs(np.arange(len(means)) - answer) > max(apart, length)]
        return float(means[answer] - rivals.max()) if len(rivals) else float("nan")
