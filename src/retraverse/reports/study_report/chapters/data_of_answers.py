"""Chapter 6, what an answer weighs: the smallest K with 100 %, and accuracy for its bytes."""

import math
from collections.abc import Iterable, Sequence

from retraverse.reports.study_report.artefacts import Artefact, Cell, Table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    long_table,
    whole_cell,
)
from retraverse.reports.study_report.figures import PERCENT, scattered
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import compression_text, meanings, size_text
from retraverse.studies.judging.selection import data_per_answer, length_of, smallest_length
from retraverse.studies.keeping.records import RunRecord

__all__ = ["data_figure", "first_full", "frontier", "smallest_data_table"]


def first_full(runs: Sequence[RunRecord]) -> RunRecord | None:
    """Return the run with the smallest K with 100 %, None if there is none."""
    smallest = smallest_length(tuple(run for run in runs if length_of(run) is not None))
    return None if smallest is None else smallest.first


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
                            Cell(place.query_text, float(place.compression_query)),
                            Cell(
                                compression_text(place.compression_reference),
                                float(place.compression_reference),
                            ),
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


def data_figure(runs: Runs) -> Artefact:
    """Return accuracy over the bytes of an answer: what a robot gets for what it sends."""

    def points(series: Series, dataset: str) -> list[tuple[float, float, RunRecord]]:
        found = []
        for place in runs.places_of(series, dataset):
            if not place.is_mixed:
                # One part of JPEG is nothing that could be sent.
                fixed = [
                    run
                    for run in runs.at(series, dataset, place)
                    if length_of(run) and not run.jpeg_part
                ]
                step = max(1, len(fixed) // 10)
                found += [
                    (data_per_answer(run) / 1000, 100 * run.accuracy, run) for run in fixed[::step]
                ]
        return frontier(found)

    return scattered(
        runs,
        points,
        number="",
        title="Accuracy for the bytes of an answer",
        x_label="d, kB",
        y_label="Accuracy, %",
        caption="Every mix of c and K (some ten K of each) that no cheaper mix of its line beats; "
        "JPEG files of query and map compressed alike.",
        definitions=meanings("d", "accuracy"),
        is_log=(True, False),
        y_limits=PERCENT,
        is_joined=True,
    )


def frontier(
    points: Iterable[tuple[float, float, RunRecord]],
) -> list[tuple[float, float, RunRecord]]:
    """Return the points (x, y, run) that none with a smaller x is as high as, left to right."""
    kept: list[tuple[float, float, RunRecord]] = []
    finite = [point for point in points if math.isfinite(point[0])]
    for point in sorted(finite, key=lambda point: (point[0], -point[1])):
        if not kept or point[1] > kept[-1][1]:
            kept.append(point)
    return kept
