"""Figures of many chapters: a value over K, over compression, over size, or side by side."""

import math
from collections.abc import Callable, Sequence

from retraverse.reports.study_report.artefacts import Figure, Line, Panel
from retraverse.reports.study_report.panels import draw_dots, draw_lines
from retraverse.reports.study_report.series import Place, Runs, Series
from retraverse.reports.study_report.words import compression_text, dataset_title, measured_on
from retraverse.studies.records import RunRecord
from retraverse.studies.selection import length_of

__all__ = [
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

Value = Callable[[RunRecord], float]
"""What a figure shows of a run; NaN where it has none."""
Picker = Callable[[Sequence[RunRecord]], RunRecord | None]
"""Which run of a line at one place a figure shows."""
PERCENT = (0.0, 103.0)


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
            0 if place.resize == 0 else 1 / place.resize,
        ),
        default=None,
    )


def size_ticks(runs: Runs) -> list[int]:
    """Return the sizes pictures were brought to, small to large, 0 (as they are) last."""
    sizes = {record.resize for record in runs.records}
    return sorted(sizes, key=lambda size: size or math.inf)


def over_length(
    runs: Runs,
    value: Value,
    *,
    number: str,
    title: str,
    y_label: str,
    caption: str = "",
    definitions: tuple[tuple[str, str], ...] = (),
    until: Callable[[Sequence[RunRecord]], int | None] | None = None,
    longest: int | None = None,
    y_limits: tuple[float, float] | None = None,
    is_log: bool = False,
) -> Figure:
    """Return a value over the fixed K, a panel for each dataset, pictures worsened least.

    `until` gives the last K drawn of a line, None for all of it; `longest` the last of all lines.
    """

    def line(series: Series, dataset: str) -> Line | None:
        place = plainest(runs.places_of(series, dataset))
        fixed = [run for run in runs.at(series, dataset, place) if length_of(run)] if place else []
        last = until(fixed) if until else None
        ends = [end for end in (last, longest) if end is not None]
        shown = [run for run in fixed if int(run.sequence_length) <= min(ends, default=10**9)]
        return _line(series, [float(run.sequence_length) for run in shown], shown, value)

    panels = _panels(
        f"{number} {title}",
        runs,
        line,
        x_label="Sequence length K, frames",
        y_label=y_label,
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, _with_left_out(caption, runs), definitions)


def over_compression(
    runs: Runs,
    value: Value,
    *,
    number: str,
    title: str,
    y_label: str,
    pick: Picker = first_run,
    where: Callable[[Place], bool] = lambda place: place.is_uniform,
    compression: Callable[[Place], int] = lambda place: place.compression_query,
    x_label: str = "JPEG compression c, %",
    caption: str = "",
    definitions: tuple[tuple[str, str], ...] = (),
    y_limits: tuple[float, float] | None = None,
    is_log: bool = False,
    with_interval: bool = False,
) -> Figure:
    """Return a value over c, a panel for each dataset, a step for each c of the study."""
    steps = sorted({compression(place) for place in runs.places if where(place)})

    def line(series: Series, dataset: str) -> Line | None:
        size = max((place.resize for place in runs.places_of(series, dataset)), default=0)
        places = [
            place
            for place in runs.places_of(series, dataset)
            if where(place) and place.resize == size
        ]
        picked = [
            (float(steps.index(compression(place))), run)
            for place in places
            if (run := pick(runs.at(series, dataset, place))) is not None
        ]
        picked.sort(key=lambda item: item[0])
        return _line(
            series, [x for x, _ in picked], [run for _, run in picked], value, with_interval
        )

    panels = _panels(
        f"{number} {title}",
        runs,
        line,
        x_label=x_label,
        y_label=y_label,
        x_ticks=[compression_text(step) for step in steps],
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, _with_left_out(caption, runs), definitions)


def over_size(
    runs: Runs,
    value: Value,
    *,
    number: str,
    title: str,
    y_label: str,
    caption: str = "",
    definitions: tuple[tuple[str, str], ...] = (),
    y_limits: tuple[float, float] | None = None,
    is_log: bool = False,
    with_interval: bool = False,
    where: Callable[[Series], bool] = lambda series: True,
) -> Figure:
    """Return a value over the pictures' size, a panel for each dataset."""
    sizes = size_ticks(runs)

    def line(series: Series, dataset: str) -> Line | None:
        picked = sizes_of(runs, series, dataset) if where(series) else []
        return _line(
            series,
            [float(sizes.index(run.resize)) for run in picked],
            picked,
            value,
            with_interval,
        )

    panels = _panels(
        f"{number} {title}",
        runs,
        line,
        x_label="Picture size, px",
        y_label=y_label,
        x_ticks=[str(size) if size else "as is" for size in sizes],
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, _with_left_out(caption, runs), definitions)


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

    panels = _panels(
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


def _with_left_out(caption: str, runs: Runs) -> str:
    n_all, n_drawn = len(runs.series), len(runs.drawn)
    if n_all == n_drawn:
        return caption
    return f"The {n_drawn} most accurate of {n_all} lines; the tables have all. {caption}".strip()


def weighted_means(figure: Figure, *, number: str, title: str, caption: str, weigh: bool) -> Figure:
    """Return the mean of a figure's panels; `weigh` counts every query picture once.

    A point is drawn only where all of the panels that have the line have it.
    """
    lines: dict[Series, list[Line]] = {}
    for panel in figure.panels:
        for line in panel.lines:
            lines.setdefault(line.series, []).append(line)
    means = [_mean_line(series, of_series, weigh) for series, of_series in sorted(lines.items())]
    if len(figure.panels) < 2:
        return Figure(number, title, (), caption, figure.definitions)
    first = figure.panels[0]
    panel = draw_lines(
        f"Mean of {len(figure.panels)} datasets",
        "every picture counts once" if weigh else "every dataset counts once",
        means,
        name=f"{number} {title}",
        x_label=first.x_label,
        y_label=first.y_label,
        x_ticks=first.x_ticks,
        is_log=first.is_log,
        y_limits=PERCENT if "%" in first.y_label else None,
    )
    return Figure(number, title, (panel,), caption, figure.definitions)


def _mean_line(series: Series, lines: Sequence[Line], weigh: bool) -> Line:
    common = sorted(set.intersection(*(set(line.x) for line in lines)))
    means = []
    for x in common:
        at = [(line.y[line.x.index(x)], line.runs[line.x.index(x)]) for line in lines]
        weights = [run.n_queries if weigh and run else 1 for _, run in at]
        total = sum(weight * y for weight, (y, _) in zip(weights, at, strict=True))
        means.append(total / sum(weights))
    return Line(series, tuple(common), tuple(means), (None,) * len(common))


def _line(
    series: Series,
    x: Sequence[float],
    runs: Sequence[RunRecord],
    value: Value,
    with_interval: bool = False,
) -> Line:
    has_interval = with_interval and all(math.isfinite(run.accuracy_low) for run in runs)
    return Line(
        series,
        tuple(x),
        tuple(value(run) for run in runs),
        tuple(runs),
        tuple(100 * run.accuracy_low for run in runs) if has_interval else (),
        tuple(100 * run.accuracy_high for run in runs) if has_interval else (),
    )


def _panels(
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
