"""Matchers under compression: which one finds the place when pictures are poor, and its time."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from retraverse.reports.study_report.artefacts import Artefact, Cell, Figure, Line, Row, Table
from retraverse.reports.study_report.chapters.context import seconds_cell
from retraverse.reports.study_report.figures import PERCENT
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Runs, Series, SeriesBook
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_order,
    dataset_title,
    meanings,
    measured_on,
)
from retraverse.reports.wording import NOTHING, percent
from retraverse.studies.keeping.records import RunRecord

__all__ = ["matcher_means", "matcher_tables"]


@dataclass(frozen=True)
class _Entry:
    """One row: a technique with a matcher and a length, and its run at each c."""

    series: Series
    matcher: str
    length: str
    by_step: dict[int, RunRecord]


def _entries(runs: Sequence[RunRecord], dataset: str) -> list[_Entry]:
    """Return the rows of a dataset."""
    # Named as if all had one matcher: the matcher has a column of its own.
    named = Runs([replace(run, matcher="mean") for run in runs], SeriesBook({}))
    found: dict[tuple[Series, str, str], dict[int, RunRecord]] = {}
    for run in runs:
        if run.dataset == dataset:
            key = (named.series_of(run), run.matcher, run.sequence_length)
            found.setdefault(key, {})[run.compression_query] = run
    return [_Entry(*key, by_step) for key, by_step in sorted(found.items())]


def _steps(entries: Iterable[_Entry]) -> list[int]:
    return sorted({step for entry in entries for step in entry.by_step})


def _highest(values: Iterable[float]) -> float:
    return max((value for value in values if math.isfinite(value)), default=math.nan)


def matcher_tables(runs: Sequence[RunRecord]) -> tuple[Table, ...]:
    """Return, for each dataset, the accuracy of every technique and matcher at every c.

    The best of each column is marked; with it stand the 95 % intervals.

    Parameters
    ----------
    runs : sequence of RunRecord
        As `chosen.compared_matchers` returns them.
    """
    return tuple(_table(runs, dataset) for dataset in _datasets(runs))


def _datasets(runs: Iterable[RunRecord]) -> list[str]:
    return sorted({run.dataset for run in runs}, key=dataset_order)


def _table(runs: Sequence[RunRecord], dataset: str) -> Table:
    entries = _entries(runs, dataset)
    steps = _steps(entries)
    best = {
        step: _highest(entry.by_step[step].accuracy for entry in entries if step in entry.by_step)
        for step in steps
    }
    sample = next(iter(entries[0].by_step.values()))
    return Table(
        "",
        f"{dataset_title(dataset)}: every matcher at every compression",
        (
            "Technique",
            "Matcher",
            "K",
            *(f"c = {compression_text(step)}" for step in steps),
            "t_m",
            "t_e",
        ),
        tuple(_row(entry, steps, best) for entry in entries),
        f"Accuracy on {measured_on(sample)}; in brackets its 95 % interval in per cent. Bold: the "
        "best of its column. A row whose interval reaches the best is not shown to be worse. "
        f"Times at c = {compression_text(steps[0])}.",
        meanings("accuracy", "interval", "c", "K", "t_m", "t_e"),
        lead=2,
    )


def _row(entry: _Entry, steps: Sequence[int], best: dict[int, float]) -> Row:
    first = entry.by_step[min(entry.by_step)]
    return Row(
        (
            Cell(entry.series.label, run=first),
            Cell(entry.matcher),
            Cell(entry.length, first.mean_sequence_length),
            *(_accuracy_cell(entry.by_step.get(step), best[step]) for step in steps),
            seconds_cell(first.match_s),
            seconds_cell(first.encode_s),
        ),
        entry.series.technique,
    )


def _accuracy_cell(run: RunRecord | None, best: float) -> Cell:
    if run is None:
        return Cell(NOTHING, math.nan)
    known = math.isfinite(run.accuracy_low)
    return Cell(
        percent(run.accuracy),
        run.accuracy,
        run,
        note=f"({100 * run.accuracy_low:.0f} to {100 * run.accuracy_high:.0f})" if known else "",
        is_best=run.accuracy >= best,
    )


def matcher_means(runs: Sequence[RunRecord]) -> tuple[Artefact, ...]:
    """Return the mean over the techniques, for each matcher: a table and a figure.

    Only matchers that met all techniques at all c of a dataset are in it, so that all means are
    over the same pictures and techniques.
    """
    groups = {dataset: _means(_entries(runs, dataset)) for dataset in _datasets(runs)}
    shown = {dataset: means for dataset, means in groups.items() if len(means) > 1}
    if not shown:
        return ()
    return (_means_table(shown), _means_figure(runs, shown))


@dataclass(frozen=True)
class _Mean:
    """A matcher's means over the techniques of one dataset."""

    matcher: str
    n_techniques: int
    accuracy: dict[int, float]
    match_s: float


def _means(entries: Sequence[_Entry]) -> list[_Mean]:
    kinds: dict[str, list[_Entry]] = {}
    for entry in entries:
        kinds.setdefault(entry.matcher, []).append(entry)
    steps = _steps(entries)
    most = max(map(len, kinds.values()), default=0)
    return [
        _Mean(
            matcher,
            len({entry.series for entry in of}),
            {step: _mean(of, step, lambda run: run.accuracy) for step in steps},
            _mean(of, steps[0], lambda run: run.match_s),
        )
        for matcher, of in kinds.items()
        if len(of) == most and all(set(entry.by_step) == set(steps) for entry in of)
    ]


def _mean(entries: Sequence[_Entry], step: int, value: Callable[[RunRecord], float]) -> float:
    return sum(value(entry.by_step[step]) for entry in entries) / len(entries)


def _means_table(groups: dict[str, list[_Mean]]) -> Table:
    steps = sorted({step for means in groups.values() for mean in means for step in mean.accuracy})
    rows = []
    for dataset, means in groups.items():
        best = {step: _highest(mean.accuracy.get(step, math.nan) for mean in means)
                for step in steps}  # fmt: skip
        for mean in means:
            values = [(step, mean.accuracy.get(step, math.nan)) for step in steps]
            cells = (
                Cell(percent(value), value, is_best=value >= best[step]) for step, value in values
            )
            n = mean.n_techniques
            head = (Cell(mean.matcher), Cell(dataset_title(dataset)), Cell(str(n), float(n)))
            rows.append(Row((*head, *cells, seconds_cell(mean.match_s))))
    return Table(
        "",
        "Matchers under compression, mean of the techniques",
        (
            "Matcher",
            "Dataset",
            "Techniques",
            *(f"c = {compression_text(step)}" for step in steps),
            "t_m",
        ),
        tuple(rows),
        "Mean accuracy; bold: the best of its dataset. “mean” is the thesis' own: the mean score "
        f"of a sequence. t_m is the mean at c = {compression_text(steps[0])}.",
        meanings("accuracy", "c", "t_m"),
        lead=2,
    )


def _means_figure(runs: Sequence[RunRecord], groups: dict[str, list[_Mean]]) -> Figure:
    panels, book = [], SeriesBook({})
    for dataset, means in groups.items():
        steps = sorted(means[0].accuracy)
        sample = next(run for run in runs if run.dataset == dataset)
        lines = [
            Line(
                book.get(mean.matcher, ""),
                tuple(map(float, range(len(steps)))),
                tuple(100 * mean.accuracy[step] for step in steps),
                (None,) * len(steps),
            )
            for mean in means
        ]
        panels.append(
            draw_lines(
                dataset_title(dataset),
                f"{measured_on(sample)}; mean of {means[0].n_techniques} techniques",
                lines,
                name="matchers under compression",
                x_label="JPEG compression c, %",
                y_label="Accuracy, %",
                x_ticks=[compression_text(step) for step in steps],
                y_limits=PERCENT,
            )
        )
    return Figure(
        "",
        "Matchers over compression, mean of the techniques",
        tuple(panels),
        "Query and map compressed alike.",
        meanings("accuracy", "c"),
    )
