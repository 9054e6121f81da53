"""The windows of a comparison, one by one: what each answered, and which are worth showing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from retraverse.studies.comparison_record import ComparisonRecord
from retraverse.types import IntArray

__all__ = ["Verdict", "Window", "evenly", "spread", "windows_of"]

Verdict = Literal["correct", "wrong", "refused", "unknown"]
"""``refused``: answered "no match"; ``unknown``: answered, but there is no ground truth."""


@dataclass(frozen=True)
class Window:
    """One window of query frames and its answer."""

    query: int
    """First query frame."""
    reference: int
    """First frame of the matched window; -1 = answered "no match"."""
    score: float
    sequence_length: int
    margin: float
    """See `ComparisonRecord.margins`; may be NaN."""
    verdict: Verdict
    is_right: bool | None
    """Whether the answer was right, "no match" included; None without ground truth."""
    true_reference: int | None
    """The middle of the true place nearest to the answer; None if unknown or not in the map."""
    frames_off: int | None
    """Frames from the answer to `true_reference`; None where either is missing."""


def windows_of(record: ComparisonRecord) -> list[Window]:
    """Return every window of the record, in the order of its matches."""
    matches, margins = record.matches, record.margins()
    return [
        _window(record, at, int(query), float(margin))
        for at, (query, margin) in enumerate(zip(matches.query, margins, strict=True))
    ]


def _window(record: ComparisonRecord, at: int, query: int, margin: float) -> Window:
    reference = int(record.matches.reference[at])
    true_reference, frames_off = None, None
    positives = _positives(record, query)
    if len(positives):
        true_reference = _true_reference(positives, reference)
        frames_off = abs(true_reference - reference) if reference >= 0 else None
    return Window(
        query=query,
        reference=reference,
        score=float(record.matches.score[at]),
        sequence_length=int(record.matches.sequence_length[at]),
        margin=margin,
        verdict=_verdict(record, at, reference),
        is_right=None if record.evaluation is None else bool(record.evaluation.correct[at]),
        true_reference=true_reference,
        frames_off=frames_off,
    )


def _positives(record: ComparisonRecord, query: int) -> IntArray:
    """Return the true references of a query that are in the map; none without ground truth."""
    if record.truth is None:
        return np.zeros(0, np.int64)
    positives = record.truth.positives[query]
    return positives[positives < record.reference.n_frames]


def _verdict(record: ComparisonRecord, at: int, reference: int) -> Verdict:
    if reference < 0:
        return "refused"
    if record.evaluation is None:
        return "unknown"
    return "correct" if record.evaluation.correct[at] else "wrong"


def _true_reference(positives: IntArray, reference: int) -> int:
    """Return the middle of the run of consecutive positives that is nearest to `reference`."""
    runs = np.split(positives, np.flatnonzero(np.diff(positives) > 1) + 1)
    nearest = min(runs, key=lambda run: int(np.abs(run - reference).min()))
    return int(nearest[len(nearest) // 2])


def spread(windows: Sequence[Window], n: int, *, apart: int) -> list[Window]:
    """Return up to `n` of the windows in their order, none within `apart` frames of another.

    Neighbours look alike; a sheet of them would show one place many times.
    """
    chosen: list[Window] = []
    for window in windows:
        if len(chosen) < n and all(abs(window.query - other.query) >= apart for other in chosen):
            chosen.append(window)
    return chosen


def evenly(windows: Sequence[Window], n: int) -> list[Window]:
    """Return `n` of the windows at even steps, first and last among them; all if fewer."""
    if len(windows) <= n:
        return list(windows)
    if n <= 0:
        return []
    steps = np.linspace(0, len(windows) - 1, n).round().astype(int)
    return [windows[step] for step in steps]
