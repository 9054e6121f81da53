"""One panel for each dataset, from what gives a line's points there."""

import math
from collections.abc import Callable, Sequence

from retraverse.reports.study_report.artefacts import Line, Panel
from retraverse.reports.study_report.figures.values import Value
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import dataset_title, measured_on
from retraverse.studies.keeping.records import RunRecord

__all__ = ["dataset_panels", "line_of_runs", "with_left_out"]


def dataset_panels(
    name: str,
    runs: Runs,
    line_of: Callable[[Series, str], Line | None],
    *,
    x_label: str,
    y_label: str,
    x_ticks: Sequence[str] = (),
    is_log: tuple[bool, bool] = (False, False),
    y_limits: tuple[float, float] | None = None,
    is_joined: bool = True,
) -> tuple[Panel, ...]:
    """Draw a panel for each dataset that has anything to draw."""
    panels = []
    for dataset in runs.datasets:
        lines = [line for series in runs.drawn if (line := line_of(series, dataset)) and line.x]
        drawn = [y for line in lines for y in line.y if math.isfinite(y)]
        if not drawn:
            continue
        record = next(run for line in lines for run in line.runs if run is not None)
        panels.append(
            draw_lines(
                dataset_title(dataset),
                measured_on(record),
                lines,
                name=name,
                x_label=x_label,
                y_label=y_label,
                x_ticks=x_ticks,
                is_log=is_log,
                y_limits=y_limits,
                is_joined=is_joined,
            )
        )
    return tuple(panels)


def line_of_runs(
    series: Series,
    x: Sequence[float],
    runs: Sequence[RunRecord],
    value: Value,
    with_interval: bool = False,
) -> Line:
    """Return a line through a value of some runs, with the intervals of their accuracy."""
    has_interval = with_interval and all(math.isfinite(run.accuracy_low) for run in runs)
    return Line(
        series,
        tuple(x),
        tuple(value(run) for run in runs),
        tuple(runs),
        tuple(100 * run.accuracy_low for run in runs) if has_interval else (),
        tuple(100 * run.accuracy_high for run in runs) if has_interval else (),
    )


def with_left_out(caption: str, runs: Runs) -> str:
    """Return a caption that says how many lines are not drawn."""
    n_all, n_drawn = len(runs.series), len(runs.drawn)
    if n_all == n_drawn:
        return caption
    return f"The {n_drawn} most accurate of {n_all} lines; the tables have all. {caption}".strip()
