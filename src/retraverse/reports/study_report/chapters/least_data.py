"""Chapter 6, query and map compressed differently: every line at its c of least data."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from retraverse.metrics import t_total
from retraverse.reports.study_report.artefacts import Artefact, Cell, Line, Row, Table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    published_key,
    seconds_cell,
)
from retraverse.reports.study_report.chapters.data_of_answers import first_full
from retraverse.reports.study_report.figures import over_cases
from retraverse.reports.study_report.series import Place, Runs, Series
from retraverse.reports.study_report.words import dataset_title, meanings
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Pick", "least_data_picks", "mixed_figures", "total_table"]

_CASES = ("both", "map only", "query only")
"""Which pictures are compressed, in the order of the thesis' tables."""
_PUBLISHED = {"essex3in1": "6.3", "campus_loop": "6.4", "gardens_point_night": "6.5"}


@dataclass(frozen=True)
class Pick:
    """One technique on one dataset at the c of least data, and its three cases."""

    series: Series
    dataset: str
    compression: int
    cases: tuple[RunRecord | None, RunRecord | None, RunRecord | None]


def least_data_picks(runs: Runs) -> list[Pick]:
    """Return every line on every dataset at the c whose answers with 100 % take fewest bytes."""
    picks = []
    for dataset in runs.datasets:
        for series in runs.series:
            places = runs.places_of(series, dataset)
            reached = [
                (data_per_answer(run), place)
                for place in places
                if place.is_uniform
                and place.compression_query >= 0
                and (run := first_full(runs.at(series, dataset, place))) is not None
                and math.isfinite(data_per_answer(run))
            ]
            if reached:
                place = min(reached)[1]
                picks.append(_pick(runs, series, dataset, place))
    return picks


def _pick(runs: Runs, series: Series, dataset: str, place: Place) -> Pick:
    c = place.compression_query
    base = min(
        (
            min(other.compression_query, other.compression_reference)
            for other in runs.places
            if other.is_mixed
        ),
        default=0,
    )
    places = (place, Place(base, c, place.resize), Place(c, base, place.resize))
    found = [first_full(runs.at(series, dataset, each)) for each in places]
    return Pick(series, dataset, c, (found[0], found[1], found[2]))


def mixed_figures(picks: Sequence[Pick]) -> tuple[Artefact, ...]:
    """Return smallest K and t_VPR with both, only the map, only the query compressed."""
    return (
        _case_figure(
            picks,
            "Figure 6.4",
            "Smallest K with 100 % accuracy, by what is compressed",
            "K, frames",
        ),
        _case_figure(
            picks,
            "Figure 6.6",
            "t_VPR at that K, by what is compressed",
            "t_VPR, ms",
        ),
    )


def _case_figure(picks: Sequence[Pick], number: str, title: str, y_label: str) -> Artefact:
    is_time = y_label.startswith("t_VPR")
    by_dataset: dict[str, list[Line]] = {}
    samples: dict[str, RunRecord] = {}
    for pick in picks:
        points = [(float(at), run) for at, run in enumerate(pick.cases) if run is not None]
        by_dataset.setdefault(pick.dataset, []).append(
            Line(
                pick.series,
                tuple(at for at, _ in points),
                tuple(
                    1000 * run.vpr_s if is_time else float(run.sequence_length) for _, run in points
                ),
                tuple(run for _, run in points),
            )
        )
        samples[pick.dataset] = points[0][1]
    return over_cases(
        _CASES,
        [(name, samples[name], lines) for name, lines in by_dataset.items()],
        number=number,
        title=title,
        y_label=y_label,
        caption="“both”: query and map at the same c; “map only” and “query only”: the other "
        "stays clean. No point: no K reaches 100 %.",
        definitions=meanings("smallest K", "t_VPR") if is_time else meanings("smallest K"),
        is_log=is_time,
    )


def total_table(given: ChapterInput, runs: Runs, dataset: str, picks: Sequence[Pick]) -> Artefact:
    """Return what one answer costs in time on a dataset, compressing included."""
    number = _PUBLISHED.get(dataset, "6.6")
    rows = [
        _total_row(given, number, pick, case, run)
        for pick in picks
        if pick.dataset == dataset
        for case, run in enumerate(pick.cases)
    ]
    return Table(
        "Tables 6.3 to 6.6",
        f"{dataset_title(dataset)}: time of one answer",
        ("Technique", "Compressed", "c", "K", "t_m", "t_e × K", "t_VPR", "t_c × K", "t_total"),
        tuple(rows),
        "At the c whose answers take the fewest bytes. Compression is paid where both are "
        "compressed on the way (selection rules).",
        meanings("t_m", "t_e", "t_VPR", "t_c", "t_total"),
        lead=2,
        is_published=True,
    )


def _total_row(
    given: ChapterInput, number: str, pick: Pick, case: int, run: RunRecord | None
) -> Row:
    technique = pick.series.technique
    head = (Cell(pick.series.label, run=run), Cell(_CASES[case], float(case)))
    if run is None:
        cells = (Cell(str(pick.compression), float(pick.compression)), Cell("none", math.inf))
        return Row((*head, *cells, *(Cell(NOTHING, math.nan) for _ in range(5))), technique)
    row = f"{published_key(run)}_{('uniform', 'map', 'query')[case]}"
    same_c = given.published(number, run, "c", row=row) == str(pick.compression)

    def thesis(column: str, unit: str = "") -> str:
        value = given.published(number, run, column, row=row) if same_c else ""
        return f"{value}{unit}" if value else ""

    length = float(run.sequence_length)
    compress_s = run.compress_s if case == 0 else 0.0
    total = t_total(run.encode_s, run.match_s, compress_s, length) if _timed(run) else math.nan
    compressing = compress_s * length if case == 0 else math.nan
    return Row(
        (
            *head,
            Cell(str(pick.compression), float(pick.compression)),
            Cell(run.sequence_length, length, run, thesis("K")),
            seconds_cell(run.match_s, None, thesis("t_m", " s")),
            seconds_cell(run.encode_s * length, None, thesis("t_e K", " s")),
            seconds_cell(run.vpr_s, None, thesis("t_VPR", " s")),
            seconds_cell(compressing, None, thesis("t_c K", " s")),
            seconds_cell(total, None, thesis("t_total", " s")),
        ),
        technique,
    )


def _timed(run: RunRecord) -> bool:
    return all(math.isfinite(value) for value in (run.encode_s, run.match_s, run.compress_s))
