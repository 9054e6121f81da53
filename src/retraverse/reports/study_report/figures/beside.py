"""Techniques side by side, cases side by side, and points of two values."""

import math
from collections.abc import Callable, Sequence

from retraverse.reports.study_report.artefacts import Figure, Line
from retraverse.reports.study_report.figures.panels_of import dataset_panels
from retraverse.reports.study_report.figures.values import PERCENT, Value, first_run, plainest
from retraverse.reports.study_report.panels import draw_dots, draw_lines
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import dataset_title, measured_on
from retraverse.studies.keeping.records import RunRecord

__all__ = ["over_cases", "scattered", "side_by_side"]


def over_cases(
    cases: Sequence[str],
    lines: Sequence[tuple[str, RunRecord, Sequence[Line]]],
    *,
    number: str,
    title: str,
    y_label: str,
    caption: str,
    definitions: tuple[tuple[str, str], ...] = (),
    is_log: bool = False,
) -> Figure:
    """Return a value for named cases; `lines` are (dataset, any run of it, its lines)."""
    panels = tuple(
        draw_lines(
            dataset_title(dataset),
            measured_on(record),
            of_dataset,
            name=f"{number} {title}",
            x_label="",
            y_label=y_label,
            x_ticks=cases,
            is_log=(False, is_log),
        )
        for dataset, record, of_dataset in lines
    )
    return Figure(number, title, panels, caption, definitions)


def scattered(
    runs: Runs,
    points: Callable[[Series, str], Sequence[tuple[float, float, RunRecord]]],
    *,
    number: str,
    title: str,
    x_label: str,
    y_label: str,
    caption: str,
    definitions: tuple[tuple[str, str], ...] = (),
    is_log: tuple[bool, bool] = (False, False),
    y_limits: tuple[float, float] | None = PERCENT,
    is_joined: bool = False,
) -> Figure:
    """Return points (x, y, run) of every line, a panel for each dataset."""

    def line(series: Series, dataset: str) -> Line | None:
        found = points(series, dataset)
        return Line(
            series,
            tuple(x for x, _, _ in found),
            tuple(y for _, y, _ in found),
            tuple(run for _, _, run in found),
        )

    panels = dataset_panels(
        f"{number} {title}",
        runs,
        line,
        x_label=x_label,
        y_label=y_label,
        is_log=is_log,
        y_limits=y_limits,
        is_joined=is_joined,
    )
    return Figure(number, title, panels, caption, definitions)


def side_by_side(
    runs: Runs,
    value: Value,
    *,
    number: str,
    title: str,
    x_label: str,
    caption: str = "",
    definitions: tuple[tuple[str, str], ...] = (),
    is_log: bool = False,
    with_interval: bool = False,
) -> Figure:
    """Return one value of every technique in rows, a panel for each dataset."""
    panels = []
    for dataset in runs.datasets:
        lines = []
        for series in runs.series:
            place = plainest(runs.places_of(series, dataset))
            run = first_run(runs.at(series, dataset, place)) if place else None
            if run is None:
                continue
            interval = with_interval and math.isfinite(run.accuracy_low)
            low = (100 * run.accuracy_low,) if interval else ()
            high = (100 * run.accuracy_high,) if interval else ()
            lines.append(Line(series, (value(run),), (0.0,), (run,), low, high))
        if any(math.isfinite(line.x[0]) for line in lines):
            record = lines[0].runs[0]
            assert record is not None
            panels.append(
                draw_dots(
                    dataset_title(dataset),
                    measured_on(record),
                    lines,
                    name=f"{number} {title}",
                    x_label=x_label,
                    is_log=is_log,
                )
            )
    return Figure(number, title, tuple(panels), caption, definitions)
