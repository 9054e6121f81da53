"""Ways of sending what a place is recognised by, compared at equal accuracy.

The same query, technique and K with everything else alike, once as JPEG files, once as groups of a
video codec, once as descriptors in some coding: what does a window weigh?
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from retraverse.reports.study_report.artefacts import Cell, Figure, Line, Panel, Table
from retraverse.reports.study_report.chapters.beyond.chosen import settings_with
from retraverse.reports.study_report.chapters.context import ChapterInput, long_table
from retraverse.reports.study_report.chapters.data_of_answers import frontier
from retraverse.reports.study_report.choices import cheapest
from retraverse.reports.study_report.figures import PERCENT
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Runs, Series, SeriesBook
from retraverse.reports.study_report.words import (
    dataset_title,
    meanings,
    measured_on,
    sent_text,
    size_text,
)
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Way", "WayCase", "saved_share", "way_cases", "ways_figures", "ways_table"]


class Way(NamedTuple):
    """How the query of a run was sent."""

    rank: int
    """Of its kind in tables, the base's 0."""
    name: str
    """ "" = in no way that is compared."""


@dataclass(frozen=True)
class WayCase:
    """One technique with one K on one dataset, its query sent in every way."""

    series: Series
    dataset: str
    length: str
    base: str
    """The way that the others are measured against."""
    by_way: Mapping[str, Sequence[RunRecord]]
    """The base first."""

    @property
    def finest(self) -> RunRecord:
        """Return the run of the base that sends most; of equals the most accurate."""
        return max(
            self.by_way[self.base],
            key=lambda run: (data_per_answer(run), run.accuracy, run.run_id),
        )

    def cheapest(self, way: str) -> RunRecord | None:
        """Return the run of fewest bytes that is not shown to be worse than the finest."""
        return cheapest(self.by_way.get(way, ()), self.finest.accuracy_low, data_per_answer)


def way_cases(
    records: Iterable[RunRecord],
    base: str,
    way_of: Callable[[RunRecord], Way],
    is_wanted: Callable[[RunRecord], bool],
) -> list[WayCase]:
    """Return what there is to compare: settings and maps with runs of the base and of others.

    Parameters
    ----------
    records : iterable of RunRecord
    base : str
        The way that the others are measured against.
    way_of : callable
        How a run's query was sent.
    is_wanted : callable
        Says whether a run makes its setting and map worth comparing.
    """
    compared = [run for run in records if way_of(run).name]
    groups = [
        of_map
        for runs in settings_with(compared, is_wanted).values()
        for of_map in _by_map(runs)
        if any(map(is_wanted, of_map))
    ]
    plain = [
        replace(run, video="", group_length=0, encoder="", descriptor_coding="")
        for runs in groups
        for run in runs
    ]
    named = Runs(plain, SeriesBook({}))
    cases = []
    for runs in groups:
        by_way: dict[str, list[RunRecord]] = {base: []}
        for run in sorted(runs, key=lambda run: (way_of(run), -data_per_answer(run), run.run_id)):
            by_way.setdefault(way_of(run).name, []).append(run)
        if by_way[base] and len(by_way) > 1:
            first = runs[0]
            series = named.series_of(first)
            cases.append(WayCase(series, first.dataset, first.sequence_length, base, by_way))
    return cases


def _by_map(runs: Iterable[RunRecord]) -> list[list[RunRecord]]:
    """Return the runs of each map: pictures as they are, or compressed alike."""
    found: dict[tuple[int, str], list[RunRecord]] = {}
    for run in runs:
        compression = run.compression_reference
        found.setdefault((compression, run.encoder if compression >= 0 else ""), []).append(run)
    return [found[key] for key in sorted(found)]


def saved_share(case: WayCase, way: str, against: str) -> float:
    """Return 1 - bytes / bytes of two ways at equal accuracy; NaN if one of them has none."""
    ours, theirs = (_data(case.cheapest(name)) for name in (way, against))
    return 1 - ours / theirs if theirs > 0 else math.nan


def _data(run: RunRecord | None) -> float:
    return math.nan if run is None else data_per_answer(run)


def ways_figures(cases: Sequence[WayCase], title: str) -> tuple[Figure, ...]:
    """Return a figure for each dataset, accuracy over the bytes of a window: a line for each way.

    Parameters
    ----------
    cases : sequence of WayCase
    title : str
        What follows the dataset's name.
    """
    book = SeriesBook({})
    for name in _ways_of(cases):
        book.get(name, "")
    datasets = dict.fromkeys(case.dataset for case in cases)
    return tuple(
        _figure([case for case in cases if case.dataset == one], book, title) for one in datasets
    )


def _ways_of(cases: Sequence[WayCase]) -> list[str]:
    """Return the names of all ways, in the order of the cases that have most of them."""
    fullest = sorted(cases, key=lambda case: -len(case.by_way))
    return list(dict.fromkeys(name for case in fullest for name in case.by_way))


def _figure(cases: Sequence[WayCase], book: SeriesBook, title: str) -> Figure:
    by_technique: dict[Series, list[WayCase]] = {}
    for case in cases:
        by_technique.setdefault(case.series, []).append(case)
    return Figure(
        "",
        f"{dataset_title(cases[0].dataset)}: {title}",
        tuple(_panel(series, some, book) for series, some in sorted(by_technique.items())),
        "Every setting and K that no cheaper one of the same way beats. Higher and further to the "
        "left is better.",
        meanings("accuracy", "group bytes", "K"),
    )


def _panel(series: Series, cases: Sequence[WayCase], book: SeriesBook) -> Panel:
    lines = []
    for way in _ways_of(cases):
        found = frontier(
            (data_per_answer(run) / 1000, 100 * run.accuracy, run)
            for case in cases
            for run in case.by_way.get(way, ())
        )
        x, y, runs = zip(*found, strict=True) if found else ((), (), ())
        lines.append(Line(book.get(way, ""), x, y, runs))
    drawn = draw_lines(
        series.label,
        measured_on(cases[0].finest),
        lines,
        name=f"{cases[0].base} {cases[0].dataset}",
        x_label="Bytes of a window, kB",
        y_label="Accuracy, %",
        is_log=(True, False),
        y_limits=PERCENT,
    )
    return replace(drawn, technique=series.technique)


def ways_table(
    given: ChapterInput,
    cases: Sequence[WayCase],
    title: str,
    caption: str,
    finest: str,
    *,
    with_saved: bool = False,
) -> Table:
    """Return what a window weighs in every way, at an accuracy not shown to be worse.

    Parameters
    ----------
    given : ChapterInput
    cases : sequence of WayCase
    title, caption : str
    finest : str
        What the finest run of the base is called.
    with_saved : bool
        Whether the share of the base's bytes that others save has columns of its own.
    """
    ways = _ways_of(cases)
    others = ways[1:] if with_saved else []
    return long_table(
        given,
        [(case.series, case.finest, _cells(case, ways, others)) for case in cases],
        number="",
        title=title,
        head=(
            "K",
            f"Accuracy, {finest}",
            *(f"{name}: bytes" for name in ways),
            *(f"{name}: saved" for name in others),
        ),
        caption=caption,
        definitions=meanings("accuracy", "interval", "group bytes", "K", "c"),
    )


def _cells(case: WayCase, ways: Sequence[str], others: Sequence[str]) -> tuple[Cell, ...]:
    finest = case.finest
    interval = f"({100 * finest.accuracy_low:.0f} to {100 * finest.accuracy_high:.0f})"
    return (
        Cell(case.length, finest.mean_sequence_length, note=_map_words(finest)),
        Cell(f"{100 * finest.accuracy:.1f} %", finest.accuracy, finest, note=interval),
        *(_bytes(case, name) for name in ways),
        *(_saved(saved_share(case, name, case.base)) for name in others),
    )


def _map_words(run: RunRecord) -> str:
    return f"map c = {run.compression_reference}" if run.compression_reference >= 0 else ""


def _bytes(case: WayCase, way: str) -> Cell:
    if way not in case.by_way:
        return Cell(NOTHING, math.nan)
    run = case.cheapest(way)
    if run is None:
        return Cell("none", math.inf)
    several = len({sent_text(run) for run in case.by_way[way]}) > 1
    note = sent_text(run) if several else ""
    return Cell(size_text(data_per_answer(run)), data_per_answer(run), run, note=note)


def _saved(share: float) -> Cell:
    return Cell(NOTHING, math.nan) if math.isnan(share) else Cell(f"{100 * share:,.0f} %", share)
