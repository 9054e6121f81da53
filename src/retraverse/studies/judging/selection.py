"""Which runs a table or figure shows: the selection rules, as functions over records.

Two people who follow these rules draw the same figure. Nothing here measures anything: values
are read off records, and the few derived numbers (d, boost) are one formula each.

Conventions
- A *condition* is everything about a run but its sequence length; a *curve* is its runs with a
  fixed K, shortest first. Runs that failed are in no curve.
- c is the JPEG compression in per cent, -1 where pictures are as they are.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from retraverse.metrics import data_volume, performance_per_compute_unit
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "Condition",
    "Curve",
    "SmallestLength",
    "boost",
    "bytes_sent",
    "condition_of",
    "curves_of",
    "data_per_answer",
    "largest_within",
    "least_data",
    "length_of",
    "mean_bytes",
    "per_compute_unit",
    "smallest_length",
]

_PLACE_OF_SIZE = ("resolution",)
"""Parameters that say at which size a technique works: the size is an axis, not a technique."""


@dataclass(frozen=True, order=True)
class Condition:
    """What the runs of one curve have in common."""

    dataset: str
    technique: str
    parameters: str
    """Parameters of the technique, JSON, without the size it works at."""
    matcher: str
    compression_query: int
    compression_reference: int
    encoder: str
    jpeg_part: str
    video: str
    video_quality: int
    group_length: int
    descriptor_coding: str
    resize: int
    resizer: str
    seed: int

    @property
    def is_uniform(self) -> bool:
        """Say whether query and map pictures are compressed alike, and sent as pictures."""
        alike = self.compression_query == self.compression_reference
        return alike and not (self.video or self.descriptor_coding)


Curve = tuple[RunRecord, ...]
"""Runs of one condition with a fixed K, shortest first."""


@dataclass(frozen=True)
class SmallestLength:
    """The sequence length from which every window is answered correctly."""

    first: RunRecord
    """The run with the first K at which accuracy is 1."""
    stays: RunRecord | None
    """The run with the first K from which on it stays 1; None if it falls again at the end."""


def condition_of(record: RunRecord) -> Condition:
    """Return the condition a run was made under."""
    return Condition(
        dataset=record.dataset,
        technique=record.technique,
        parameters=_steady(record.technique_parameters),
        matcher=record.matcher,
        compression_query=record.compression_query,
        compression_reference=record.compression_reference,
        encoder=record.encoder,
        jpeg_part=record.jpeg_part,
        video=record.video,
        video_quality=record.video_quality,
        group_length=record.group_length,
        descriptor_coding=record.descriptor_coding,
        resize=record.resize,
        resizer=record.resizer,
        seed=record.seed,
    )


_steady_texts: dict[str, str] = {}


def _steady(parameters: str) -> str:
    """Return parameters as sorted JSON without those that follow the pictures' size."""
    if parameters not in _steady_texts:
        values = json.loads(parameters)
        kept = {name: value for name, value in values.items() if name not in _PLACE_OF_SIZE}
        _steady_texts[parameters] = json.dumps(kept, sort_keys=True)
    return _steady_texts[parameters]


def length_of(record: RunRecord) -> int | None:
    """Return the fixed K of a run, None if its length is dynamic."""
    return int(record.sequence_length) if record.sequence_length.isdigit() else None


def curves_of(records: Iterable[RunRecord]) -> dict[Condition, Curve]:
    """Return the curve of every condition that has a measured run with a fixed K."""
    found: dict[Condition, dict[int, RunRecord]] = {}
    for record in records:
        length = length_of(record)
        if length is not None and record.status == "ok":
            found.setdefault(condition_of(record), {})[length] = record
    return {
        condition: tuple(runs[length] for length in sorted(runs))
        for condition, runs in sorted(found.items())
    }


def smallest_length(curve: Curve) -> SmallestLength | None:
    """Return the smallest K with 100 % accuracy; None if no K of the curve has it.

    Long windows leave few candidates: with as many queries as references K = Q leaves one, which
    is right by itself. Print `n_windows` and `n_candidates` beside the K.
    """
    full = [record.accuracy >= 1 for record in curve]
    if not any(full):
        return None
    first = full.index(True)
    last_fall = max((at for at, is_full in enumerate(full) if not is_full), default=-1)
    stays = curve[max(first, last_fall + 1)] if last_fall + 1 < len(curve) else None
    return SmallestLength(curve[first], stays)


def boost(curve: Curve) -> list[tuple[int, float | None]]:
    """Return (K, 100 (a_K - a_1) / a_1) along a curve; None = undefined, as a_1 is 0.

    Empty if the curve has no run with K = 1.
    """
    single = next((record.accuracy for record in curve if length_of(record) == 1), None)
    if single is None:
        return []
    return [
        (int(record.sequence_length), 100 * (record.accuracy - single) / single if single else None)
        for record in curve
    ]


def largest_within(curve: Curve, budget_s: float) -> RunRecord | None:
    """Return the run that makes the most of `budget_s` seconds of t_VPR.

    The largest K whose t_VPR fits, or the first K with 100 % accuracy if that is smaller; K = 1
    even over the budget. None for an empty curve.
    """
    if not curve:
        return None
    best = smallest_length(curve)
    fitting = [record for record in curve if record.vpr_s <= budget_s]
    if best is not None and best.first in fitting:
        return best.first
    return fitting[-1] if fitting else curve[0]


def mean_bytes(record: RunRecord) -> float:
    """Return the mean bytes of a picture over query and reference together."""
    n_pictures = record.n_queries + record.n_references
    if min(record.query_bytes_total, record.reference_bytes_total) < 0 or not n_pictures:
        return record.query_bytes_mean
    return (record.query_bytes_total + record.reference_bytes_total) / n_pictures


def bytes_sent(record: RunRecord) -> float:
    """Return the mean bytes that travel for one query frame: its picture, or its description.

    What both ends need before the first is not in it. NaN if unknown.
    """
    if not record.descriptor_coding:
        return record.query_bytes_mean
    if record.coded_bytes < 0:
        return math.nan
    nothing = record.no_descriptor_share
    return record.coded_bytes * (1 - (nothing if math.isfinite(nothing) else 0))


def data_per_answer(record: RunRecord) -> float:
    """Return d, the bytes of one window: mean size of a query picture x K; NaN if unknown.

    Where descriptors are sent in place of pictures, it is theirs.
    """
    size, length = bytes_sent(record), record.mean_sequence_length
    if not (math.isfinite(size) and math.isfinite(length)):
        return math.nan
    return data_volume(size, length)


def least_data(curves: Mapping[Condition, Curve]) -> tuple[Condition, SmallestLength] | None:
    """Return the condition whose smallest K with 100 % costs the fewest bytes d; None if none."""
    reached = [
        (condition, smallest)
        for condition, curve in curves.items()
        if (smallest := smallest_length(curve)) is not None
        and math.isfinite(data_per_answer(smallest.first))
    ]
    return min(reached, key=lambda item: data_per_answer(item[1].first), default=None)


def per_compute_unit(record: RunRecord, among: Sequence[RunRecord]) -> float:
    """Return PCU of a run among the runs it is compared with; NaN where a number is missing.

    A sequence pays its encoding time K times. The slowest to encode one picture sets t_e_max.
    """
    times = [other.encode_s for other in among if other.encode_s > 0]
    if not times or not record.encode_s > 0 or not 0 <= record.p_r100 <= 1:
        return math.nan
    length = record.mean_sequence_length if record.mean_sequence_length > 0 else 1
    return performance_per_compute_unit(
        record.p_r100, t_e=record.encode_s * length, t_e_max=max(times)
    )
