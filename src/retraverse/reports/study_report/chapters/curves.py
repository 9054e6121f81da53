"""Curves of a page's lines: their runs with fixed K on one dataset."""

from retraverse.reports.study_report.figures import plainest
from retraverse.reports.study_report.series import Runs, Series
from retraverse.studies.judging.selection import length_of
from retraverse.studies.keeping.records import RunRecord

__all__ = ["curves_by_line", "fixed_curve"]


def fixed_curve(runs: Runs, series: Series, dataset: str) -> tuple[RunRecord, ...]:
    """Return a line's runs with fixed K, pictures worsened least."""
    place = plainest(runs.places_of(series, dataset))
    found = runs.at(series, dataset, place) if place else ()
    return tuple(run for run in found if length_of(run) is not None)


def curves_by_line(runs: Runs) -> list[tuple[Series, str, tuple[RunRecord, ...]]]:
    """Return (line, dataset, curve) of every line that has one there."""
    return [
        (series, dataset, curve)
        for dataset in runs.datasets
        for series in runs.series
        if (curve := fixed_curve(runs, series, dataset))
    ]
