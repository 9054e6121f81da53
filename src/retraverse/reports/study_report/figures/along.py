"""A value along an axis of the study: sequence length, compression, picture size."""

from collections.abc import Callable, Sequence

from retraverse.reports.study_report.artefacts import Figure, Line
from retraverse.reports.study_report.figures.panels_of import (
    dataset_panels,
    line_of_runs,
    with_left_out,
)
from retraverse.reports.study_report.figures.values import (
    Picker,
    Value,
    first_run,
    plainest,
    size_ticks,
    sizes_of,
)
from retraverse.reports.study_report.series import Place, Runs, Series
from retraverse.reports.study_report.words import compression_text
from retraverse.studies.judging.selection import length_of
from retraverse.studies.keeping.records import RunRecord

__all__ = ["over_compression", "over_length", "over_size"]


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
        return line_of_runs(series, [float(run.sequence_length) for run in shown], shown, value)

    panels = dataset_panels(
        f"{number} {title}",
        runs,
        line,
        x_label="Sequence length K, frames",
        y_label=y_label,
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, with_left_out(caption, runs), definitions)


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
    """Return a value over c, a panel for each dataset, a step for each c of the study.

    What is sent as video has no c and is not shown.
    """

    def is_shown(place: Place) -> bool:
        return where(place) and not place.is_video

    steps = sorted({compression(place) for place in runs.places if is_shown(place)})

    def line(series: Series, dataset: str) -> Line | None:
        size = max((place.resize for place in runs.places_of(series, dataset)), default=0)
        places = [
            place
            for place in runs.places_of(series, dataset)
            if is_shown(place) and place.resize == size
        ]
        picked = [
            (float(steps.index(compression(place))), run)
            for place in places
            if (run := pick(runs.at(series, dataset, place))) is not None
        ]
        picked.sort(key=lambda item: item[0])
        return line_of_runs(
            series, [x for x, _ in picked], [run for _, run in picked], value, with_interval
        )

    panels = dataset_panels(
        f"{number} {title}",
        runs,
        line,
        x_label=x_label,
        y_label=y_label,
        x_ticks=[compression_text(step) for step in steps],
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, with_left_out(caption, runs), definitions)


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
        return line_of_runs(
            series,
            [float(sizes.index(run.resize)) for run in picked],
            picked,
            value,
            with_interval,
        )

    panels = dataset_panels(
        f"{number} {title}",
        runs,
        line,
        x_label="Picture size, px",
        y_label=y_label,
        x_ticks=[str(size) if size else "as is" for size in sizes],
        y_limits=y_limits,
        is_log=(False, is_log),
    )
    return Figure(number, title, panels, with_left_out(caption, runs), definitions)
