"""Chapter 6: compressed pictures in sequences, by the bytes and the time of one answer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from retraverse.metrics import t_total
from retraverse.reports.study_report.artefacts import (
    Artefact,
    Cell,
    Chapter,
    Line,
    Row,
    Section,
    Table,
)
from retraverse.reports.study_report.chapters.chapter4 import encoding_table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    long_table,
    published_key,
    seconds_cell,
    whole_cell,
)
from retraverse.reports.study_report.figures import (
    PERCENT,
    first_run,
    over_cases,
    over_compression,
    scattered,
)
from retraverse.reports.study_report.pictures_only import picture_runs
from retraverse.reports.study_report.series import Place, Runs, Series
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_title,
    meanings,
    size_text,
)
from retraverse.reports.wording import NOTHING
from retraverse.studies.records import RunRecord
from retraverse.studies.selection import (
    data_per_answer,
    length_of,
    mean_bytes,
    smallest_length,
)

__all__ = ["chapter_6", "data_figure", "first_full", "smallest_data_table"]

_CASES = ("both", "map only", "query only")
"""Which pictures are compressed, in the order of the thesis' tables."""
_PUBLISHED = {"essex3in1": "6.3", "campus_loop": "6.4", "gardens_point_night": "6.5"}


def chapter_6(given: ChapterInput) -> Chapter:
    """Return the page of chapter 6."""
    runs = _by_default_encoder(given)
    pictures = Runs(picture_runs(given.records), given.book)
    picks = _least_data_picks(runs)
    return Chapter(
        "6",
        "Compressed pictures in sequences",
        "Compression loses places and longer sequences win them back: which mix of the two sends "
        "the fewest bytes, and what time does it take?",
        (
            Section("How small do pictures become?", _sizes(given, runs, pictures)),
            Section("How long must sequences be, and what do they weigh?", _lengths(given, runs)),
            Section(
                "Query and map compressed differently",
                _mixed(picks),
                "For every technique and dataset at the c whose answers take the fewest bytes.",
            ),
            Section("What time does it take?", _times(given, runs, pictures, picks)),
        ),
        given.records,
    )


def _by_default_encoder(given: ChapterInput) -> Runs:
    """Return the runs of the chapter's encoder, the optimising one where it was used.

    Sizes, and the table of smallest K, show the plain one beside it.
    """
    optimised = [run for run in given.records if "optimize" in run.encoder or not run.encoder]
    has_any = any(run.encoder for run in optimised)
    return Runs(optimised if has_any else given.records, given.book)


def first_full(runs: Sequence[RunRecord]) -> RunRecord | None:
    """Return the run with the smallest K with 100 %, None if there is none."""
    smallest = smallest_length(tuple(run for run in runs if length_of(run) is not None))
    return None if smallest is None else smallest.first


def _sizes(given: ChapterInput, runs: Runs, pictures: Runs) -> tuple[Artefact, ...]:
    return (
        over_compression(
            pictures,
            lambda run: mean_bytes(run) / 1000,
            number="Figure 6.1",
            title="Mean size of a picture",
            y_label="Size, kB",
            definitions=meanings("picture size", "c"),
            is_log=True,
        ),
        _descriptor_table(given, runs),
    )


def _descriptor_table(given: ChapterInput, runs: Runs) -> Table:
    steps = sorted({place.compression_query for place in runs.places if place.is_uniform})
    rows = []
    for dataset in runs.datasets:
        for series in runs.series:
            by_step = {
                place.compression_query: run
                for place in runs.places_of(series, dataset)
                if place.is_uniform
                and (run := first_run(runs.at(series, dataset, place))) is not None
            }
            run = next((run for run in by_step.values() if run.descriptor_bytes > 0), None)
            if run is not None:
                size = given.published("6.1", run, "size")
                cells = (_ratio_cell(given, by_step.get(step), step) for step in steps)
                first = Cell(
                    size_text(run.descriptor_bytes),
                    float(run.descriptor_bytes),
                    published=f"{size} KB" if size else "",
                )
                rows.append((series, run, (first, *cells)))
    return long_table(
        given,
        rows,
        number="Table 6.1",
        title="A picture's size over its descriptor's",
        head=("Descriptor", *(f"c = {compression_text(step)}" for step in steps)),
        caption="Below 100 %, sending the picture is cheaper than sending its descriptor.",
        definitions=meanings("picture size", "descriptor size"),
    )


def _ratio_cell(given: ChapterInput, run: RunRecord | None, step: int) -> Cell:
    if run is None or not run.descriptor_bytes > 0:
        return Cell(NOTHING, math.nan)
    share = mean_bytes(run) / run.descriptor_bytes
    thesis = given.published("6.1", run, str(max(step, 0)))
    return Cell(_percents(100 * share), share, run, f"{thesis} %" if thesis else "")


def _percents(value: float) -> str:
    return f"{value:,.0f} %" if value >= 100 else f"{value:.3g} %"


def _lengths(given: ChapterInput, runs: Runs) -> tuple[Artefact, ...]:
    return (
        over_compression(
            runs,
            lambda run: float(run.sequence_length),
            number="Figure 6.2",
            title="Smallest K with 100 % accuracy",
            y_label="K, frames",
            pick=first_full,
            caption="No point: no K of the study reaches 100 %.",
            definitions=meanings("smallest K", "c"),
        ),
        over_compression(
            runs,
            lambda run: data_per_answer(run) / 1000,
            number="Figure 6.3",
            title="Data of one answer at that K",
            y_label="d, kB",
            pick=first_full,
            caption="The lowest point of a line is the mix to choose, if bytes are what counts.",
            definitions=meanings("d", "smallest K", "c"),
            is_log=True,
        ),
        smallest_data_table(given, given.over_length),
        data_figure(runs),
    )


def smallest_data_table(given: ChapterInput, runs: Runs) -> Table:
    """Return smallest K, what it leaves, and d, for every line, dataset and c."""
    rows = []
    for dataset in runs.datasets:
        for series in runs.series:
            for place in runs.places_of(series, dataset):
                fixed = tuple(r for r in runs.at(series, dataset, place) if length_of(r))
                smallest = smallest_length(fixed)
                if not fixed:
                    continue
                best = max(fixed, key=lambda run: run.accuracy)
                first = smallest.first if smallest else None
                stays = smallest.stays if smallest else None
                note = "" if first else f"best {100 * best.accuracy:.1f} %"
                data = data_per_answer(first) if first else math.nan
                rows.append(
                    (
                        series,
                        first or best,
                        (
                            _c_cell(place.compression_query),
                            _c_cell(place.compression_reference),
                            Cell(
                                first.sequence_length if first else "none",
                                float(first.sequence_length) if first else math.inf,
                                first,
                                note=note,
                            ),
                            whole_cell(float(stays.sequence_length) if stays else None),
                            whole_cell(first.n_windows if first else None),
                            whole_cell(first.n_candidates if first else None),
                            Cell(size_text(data), data),
                        ),
                    )
                )
    return long_table(
        given,
        rows,
        number="",
        title="Smallest K with 100 % accuracy, in numbers",
        head=(
            "c query",
            "c map",
            "Smallest K",
            "Stays from K",
            "Windows left",
            "Candidates left",
            "d",
        ),
        definitions=meanings("smallest K", "d", "c"),
    )


def _c_cell(compression: int) -> Cell:
    return Cell(compression_text(compression), float(compression))


def data_figure(runs: Runs) -> Artefact:
    """Return accuracy over the bytes of an answer: what a robot gets for what it sends."""

    def points(series: Series, dataset: str) -> list[tuple[float, float, RunRecord]]:
        found = []
        for place in runs.places_of(series, dataset):
            if place.is_uniform:
                fixed = [run for run in runs.at(series, dataset, place) if length_of(run)]
                step = max(1, len(fixed) // 10)
                found += [
                    (data_per_answer(run) / 1000, 100 * run.accuracy, run) for run in fixed[::step]
                ]
        return _frontier(found)

    return scattered(
        runs,
        points,
        number="",
        title="Accuracy for the bytes of an answer",
        x_label="d, kB",
        y_label="Accuracy, %",
        caption="Every mix of c and K (some ten K of each) that no cheaper mix beats, query and "
        "map compressed alike.",
        definitions=meanings("d", "accuracy"),
        is_log=(True, False),
        y_limits=PERCENT,
        is_joined=True,
    )


def _frontier(
    points: Sequence[tuple[float, float, RunRecord]],
) -> list[tuple[float, float, RunRecord]]:
    """Return the points that none with a smaller x is as high as, left to right."""
    kept: list[tuple[float, float, RunRecord]] = []
    finite = [point for point in points if math.isfinite(point[0])]
    for point in sorted(finite, key=lambda point: (point[0], -point[1])):
        if not kept or point[1] > kept[-1][1]:
            kept.append(point)
    return kept


@dataclass(frozen=True)
class _Pick:
    """One technique on one dataset at the c of least data, and its three cases."""

    series: Series
    dataset: str
    compression: int
    cases: tuple[RunRecord | None, RunRecord | None, RunRecord | None]


def _least_data_picks(runs: Runs) -> list[_Pick]:
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


def _pick(runs: Runs, series: Series, dataset: str, place: Place) -> _Pick:
    c = place.compression_query
    base = min(
        (
            min(other.compression_query, other.compression_reference)
            for other in runs.places
            if not other.is_uniform
        ),
        default=0,
    )
    places = (place, Place(base, c, place.resize), Place(c, base, place.resize))
    found = [first_full(runs.at(series, dataset, each)) for each in places]
    return _Pick(series, dataset, c, (found[0], found[1], found[2]))


def _mixed(picks: Sequence[_Pick]) -> tuple[Artefact, ...]:
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
            "t_VPR, s",
        ),
    )


def _case_figure(picks: Sequence[_Pick], number: str, title: str, y_label: str) -> Artefact:
    is_time = y_label.startswith("t_VPR")
    by_dataset: dict[str, list[Line]] = {}
    samples: dict[str, RunRecord] = {}
    for pick in picks:
        points = [(float(at), run) for at, run in enumerate(pick.cases) if run is not None]
        by_dataset.setdefault(pick.dataset, []).append(
            Line(
                pick.series,
                tuple(at for at, _ in points),
                tuple(run.vpr_s if is_time else float(run.sequence_length) for _, run in points),
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


def _times(
    given: ChapterInput, runs: Runs, pictures: Runs, picks: Sequence[_Pick]
) -> tuple[Artefact, ...]:
    return (
        over_compression(
            runs,
            lambda run: run.vpr_s,
            number="Figure 6.5",
            title="t_VPR at the smallest K with 100 %",
            y_label="t_VPR, s",
            pick=first_full,
            definitions=meanings("t_VPR", "smallest K", "c"),
            is_log=True,
        ),
        over_compression(
            pictures,
            lambda run: 1000 * run.compress_s,
            number="Figure 6.7",
            title="Time to compress one picture",
            y_label="t_c, ms",
            definitions=meanings("t_c", "c"),
        ),
        encoding_table(given, runs, number="6.2"),
        *(_total_table(given, runs, dataset, picks) for dataset in runs.datasets),
    )


def _total_table(given: ChapterInput, runs: Runs, dataset: str, picks: Sequence[_Pick]) -> Artefact:
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
    given: ChapterInput, number: str, pick: _Pick, case: int, run: RunRecord | None
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
