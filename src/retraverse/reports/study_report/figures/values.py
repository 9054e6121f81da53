"""What a figure shows of a run, and which run stands for a line at one place."""

import math
from collections.abc import Callable, Sequence

from retraverse.reports.study_report.series import Place, Runs, Series
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "PERCENT",
    "Picker",
    "Value",
    "accuracy_percent",
    "first_run",
    "plainest",
    "size_ticks",
    "sizes_of",
]

Value = Callable[[RunRecord], float]
"""What a figure shows of a run; NaN where it has none."""
Picker = Callable[[Sequence[RunRecord]], RunRecord | None]
"""Which run of a line at one place a figure shows."""
PERCENT = (0.0, 103.0)
"""Limits of an axis of per cent."""


def accuracy_percent(record: RunRecord) -> float:
    """Return the accuracy in per cent."""
    return 100 * record.accuracy


def first_run(runs: Sequence[RunRecord]) -> RunRecord | None:
    """Return the run of the shortest K, None of none."""
    return runs[0] if runs else None


def plainest(places: Sequence[Place]) -> Place | None:
    """Return the place where pictures are worsened least: little compressed, then large."""
    return min(
        places,
        key=lambda place: (
            max(place.compression_query, 0) + max(place.compression_reference, 0),
            max(place.video_quality, 0),
            0 if place.resize == 0 else 1 / place.resize,
        ),
        default=None,
    )


def size_ticks(runs: Runs) -> list[int]:
    """Return the sizes pictures were brought to, small to large, 0 (as they are) last."""
    sizes = {record.resize for record in runs.records}
    return sorted(sizes, key=lambda size: size or math.inf)


def sizes_of(runs: Runs, series: Series, dataset: str) -> list[RunRecord]:
    """Return a line's runs by size, compressed least."""
    by_size: dict[int, list[Place]] = {}
    for place in runs.places_of(series, dataset):
        by_size.setdefault(place.resize, []).append(place)
    picked = []
    for size in sorted(by_size, key=lambda size: size or math.inf):
        best = plainest(by_size[size])
        run = first_run(runs.at(series, dataset, best)) if best else None
        if run is not None:
            picked.append(run)
    return picked
