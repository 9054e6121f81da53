"""Figures of many chapters: a value over K, over compression, over size, or side by side.

`along` has those along an axis, `beside` those of rows, cases and points, `means` the mean of a
figure's datasets; `values` says which run stands for a line, `panels_of` draws the panels.
"""

from retraverse.reports.study_report.figures.along import over_compression, over_length, over_size
from retraverse.reports.study_report.figures.beside import over_cases, scattered, side_by_side
from retraverse.reports.study_report.figures.means import weighted_means
from retraverse.reports.study_report.figures.values import (
    PERCENT,
    Picker,
    Value,
    accuracy_percent,
    first_run,
    plainest,
    size_ticks,
    sizes_of,
)

__all__ = [
    "PERCENT",
    "Picker",
    "Value",
    "accuracy_percent",
    "first_run",
    "over_cases",
    "over_compression",
    "over_length",
    "over_size",
    "plainest",
    "scattered",
    "side_by_side",
    "size_ticks",
    "sizes_of",
    "weighted_means",
]
