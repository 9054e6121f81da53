"""At changing speed: which matcher finds the place when the query is driven at another speed."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from retraverse.datasets.driven_again import recorded_name
from retraverse.reports.study_report.artefacts import Artefact, Cell, Figure, Line, Row, Table
from retraverse.reports.study_report.chapters.beyond.chosen import driven_again, speed_words
from retraverse.reports.study_report.figures import PERCENT
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Runs, Series, SeriesBook
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_order,
    dataset_title,
    meanings,
    tolerance_text,
)
from retraverse.reports.wording import NOTHING, percent
from retraverse.studies.keeping.records import RunRecord

__all__ = ["speed_artefacts"]

Drives = Mapping[str, Mapping[str, Mapping[Series, RunRecord]]]
"""Dataset -> matcher -> technique -> run, all with one K and c."""


def speed_artefacts(records: Iterable[RunRecord]) -> tuple[Artefact, ...]:
    """Return the means over the techniques, and every technique of each recorded drive.

    For every K and c of its own.
    """
    chosen = driven_again(records)
    # Named as if all had one matcher and K: these are said beside.
    named = Runs([replace(run, matcher="mean") for run in chosen], SeriesBook({}))
    found: list[Artefact] = []
    for key in sorted({(run.sequence_length, run.compression_query) for run in chosen}):
        here = [run for run in chosen if (run.sequence_length, run.compression_query) == key]
        drives = _drives(here, named)
        said = f"K = {key[0]}, c = {compression_text(key[1])}"
        found += [_means_table(drives, said), _means_figure(drives, said)]
        recorded = dict.fromkeys(recorded_name(dataset)[0] for dataset in drives)
        found += [_table(drives, name, said) for name in recorded]
    return tuple(found)


def _drives(runs: Sequence[RunRecord], named: Runs) -> Drives:
    """Return the runs by dataset, each speed beside the drive as recorded."""
    found: dict[str, dict[str, dict[Series, RunRecord]]] = {}
    for run in sorted(runs, key=lambda run: dataset_order(run.dataset)):
        of_matcher = found.setdefault(run.dataset, {}).setdefault(run.matcher, {})
        of_matcher[named.series_of(run)] = run
    return found


def _matchers(drives: Drives) -> list[str]:
    """Return the matchers, the thesis' own first."""
    names = {matcher for of in drives.values() for matcher in of}
    return sorted(names, key=lambda name: (name != "mean", name))


def _mean(drives: Drives, dataset: str, matcher: str) -> float:
    """Return the mean over the techniques, NaN if the matcher missed one of them."""
    of_dataset = drives[dataset]
    techniques = {series for of in of_dataset.values() for series in of}
    runs = of_dataset.get(matcher, {})
    if set(runs) != techniques:
        return math.nan
    return sum(run.accuracy for run in runs.values()) / len(runs)


def _means_table(drives: Drives, said: str) -> Table:
    matchers = _matchers(drives)
    rows = []
    for dataset in drives:
        means = [_mean(drives, dataset, matcher) for matcher in matchers]
        best = max((mean for mean in means if math.isfinite(mean)), default=math.inf)
        rows.append(
            Row(
                (
                    Cell(dataset_title(recorded_name(dataset)[0])),
                    Cell(speed_words(dataset)),
                    Cell(_tolerance(drives[dataset])),
                    *(_mean_cell(mean, best) for mean in means),
                )
            )
        )
    return Table(
        "",
        f"Matchers at changing speed, mean of the techniques ({said})",
        ("Dataset", "Speed", "Right within", *matchers),
        tuple(rows),
        "Mean accuracy; bold: the best of its row. “varying speed” swings between half and twice "
        "the map's; “with stops” stands still in one frame of three; “with jumps” leaves a part "
        "out and drives it at the end. “mean” is the thesis' own, which expects the map's speed.",
        meanings("accuracy", "K", "c"),
        lead=2,
    )


def _tolerance(of_dataset: Mapping[str, Mapping[Series, RunRecord]]) -> str:
    return tolerance_text(next(run for of in of_dataset.values() for run in of.values()))


def _mean_cell(mean: float, best: float) -> Cell:
    if math.isnan(mean):
        return Cell(NOTHING, math.nan)
    return Cell(percent(mean), mean, is_best=mean >= best)


def _means_figure(drives: Drives, said: str) -> Figure:
    panels, book = [], SeriesBook({})
    by_recorded: dict[str, list[str]] = {}
    for dataset in drives:
        by_recorded.setdefault(recorded_name(dataset)[0], []).append(dataset)
    for recorded, datasets in by_recorded.items():
        lines = [
            Line(
                book.get(matcher, ""),
                tuple(map(float, range(len(datasets)))),
                tuple(100 * _mean(drives, dataset, matcher) for dataset in datasets),
                (None,) * len(datasets),
            )
            for matcher in _matchers(drives)
        ]
        panels.append(
            draw_lines(
                dataset_title(recorded),
                f"mean of {_n_techniques(drives[datasets[0]])} techniques",
                lines,
                name=f"speeds {said}",
                x_label="",
                y_label="Accuracy, %",
                x_ticks=[speed_words(dataset) for dataset in datasets],
                y_limits=PERCENT,
            )
        )
    return Figure(
        "",
        f"Matchers at changing speed ({said})",
        tuple(panels),
        "",
        meanings("accuracy"),
    )


def _n_techniques(of_dataset: Mapping[str, Mapping[Series, RunRecord]]) -> int:
    return len({series for of in of_dataset.values() for series in of})


def _table(drives: Drives, recorded: str, said: str) -> Table:
    datasets = [dataset for dataset in drives if recorded_name(dataset)[0] == recorded]
    pairs = sorted(
        {
            (series, matcher)
            for dataset in datasets
            for matcher, of in drives[dataset].items()
            for series in of
        }
    )
    rows = [_row(drives, datasets, series, matcher) for series, matcher in pairs]
    return Table(
        "",
        f"{dataset_title(recorded)}: every technique and matcher at every speed ({said})",
        ("Technique", "Matcher", *map(speed_words, datasets)),
        tuple(rows),
        "Accuracy; in brackets its 95 % interval in per cent.",
        meanings("accuracy", "interval", "K", "c"),
        lead=2,
    )


def _row(drives: Drives, datasets: Sequence[str], series: Series, matcher: str) -> Row:
    runs = [drives[dataset].get(matcher, {}).get(series) for dataset in datasets]
    return Row((Cell(series.label), Cell(matcher), *map(_cell, runs)), series.technique)


def _cell(run: RunRecord | None) -> Cell:
    if run is None:
        return Cell(NOTHING, math.nan)
    known = math.isfinite(run.accuracy_low)
    interval = f"({100 * run.accuracy_low:.0f} to {100 * run.accuracy_high:.0f})" if known else ""
    return Cell(percent(run.accuracy), run.accuracy, run, note=interval)
