"""Chapter 7: small pictures."""

import math
from collections.abc import Callable

from retraverse.reports.study_report.artefacts import (
    Artefact,
    Cell,
    Chapter,
    Figure,
    Section,
    Table,
)
from retraverse.reports.study_report.chapters.chapter5 import dataset_sizes
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    long_table,
    published_key,
    seconds_cell,
)
from retraverse.reports.study_report.figures import (
    PERCENT,
    accuracy_percent,
    over_size,
    scattered,
    size_ticks,
    sizes_of,
    weighted_means,
)
from retraverse.reports.study_report.published import published_value
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import meanings
from retraverse.reports.wording import NOTHING
from retraverse.studies.keeping.records import RunRecord

__all__ = ["chapter_7", "time_figure"]


def chapter_7(given: ChapterInput) -> Chapter:
    """Return the page of chapter 7."""
    runs = given.single_frames
    accuracy = over_size(
        runs,
        accuracy_percent,
        number="Figure 7.2",
        title="Accuracy over picture size",
        y_label="Accuracy, %",
        caption="Shaded: 95 % intervals.",
        definitions=meanings("accuracy", "interval"),
        y_limits=PERCENT,
        with_interval=True,
    )
    mean = weighted_means(
        accuracy,
        number="Figure 7.3",
        title="Accuracy over picture size, mean of the datasets",
        caption="Which size to choose, on the whole.",
        weigh=True,
    )
    return Chapter(
        "7",
        "Small pictures",
        "How small may pictures be, and which technique gets the most out of a small one in the "
        "least time?",
        (
            Section(
                "How accurate are small pictures?",
                (
                    accuracy,
                    *((mean,) if mean.panels else ()),
                    *_sequences(given),
                    *_keypoints(runs),
                    dataset_sizes(given, number="7.1", over="size"),
                ),
            ),
            Section("What time do they take?", _times(given, runs)),
        ),
        given.records,
    )


def _sequences(given: ChapterInput) -> tuple[Figure, ...]:
    """Return the same with sequences, which the thesis does not have."""
    if given.sequences is None:
        return ()
    length, runs = given.sequences
    return (
        over_size(
            runs,
            accuracy_percent,
            number="",
            title=f"Accuracy over picture size with sequences of K = {length}",
            y_label="Accuracy, %",
            caption="Added here.",
            definitions=meanings("accuracy", "interval", "K"),
            y_limits=PERCENT,
            with_interval=True,
        ),
    )


def _keypoints(runs: Runs) -> tuple[Figure, ...]:
    figure = over_size(
        runs,
        lambda run: 100 * run.no_descriptor_share,
        number="Figure 7.4",
        title="Pictures in which ORB finds nothing",
        y_label="Without keypoints, %",
        caption="What it cannot describe it cannot place: the answer is “no match”.",
        definitions=meanings("without keypoints"),
        y_limits=PERCENT,
        where=lambda series: series.technique == "orb",
    )
    return (figure,) if figure.panels else ()


def _times(given: ChapterInput, runs: Runs) -> tuple[Artefact, ...]:
    return (
        over_size(
            runs,
            lambda run: 1000 * run.vpr_s,
            number="Figure 7.5",
            title="Time of one answer over picture size",
            y_label="t_VPR, ms",
            definitions=meanings("t_VPR"),
            is_log=True,
        ),
        time_figure(runs, number="Figure 7.6"),
        _time_table(given, runs, "7.2", "Encoding time of one picture", lambda run: run.encode_s),
        _time_table(given, runs, "7.3", "Matching time of one query", lambda run: run.match_s),
    )


def time_figure(runs: Runs, *, number: str) -> Figure:
    """Return accuracy over t_VPR, a point for each size."""

    def points(series: Series, dataset: str) -> list[tuple[float, float, RunRecord]]:
        return [
            (1000 * run.vpr_s, 100 * run.accuracy, run) for run in sizes_of(runs, series, dataset)
        ]

    return scattered(
        runs,
        points,
        number=number,
        title="Accuracy against the time of one answer",
        x_label="t_VPR, ms",
        y_label="Accuracy, %",
        caption="Each point is one size, small to large along a line. Upper left is best.",
        definitions=meanings("accuracy", "t_VPR"),
        is_log=(True, False),
        is_joined=True,
    )


def _time_table(
    given: ChapterInput,
    runs: Runs,
    number: str,
    title: str,
    value: Callable[[RunRecord], float],
) -> Table:
    sizes = size_ticks(runs)
    rows = []
    for series in runs.series:
        for dataset in runs.datasets:
            by_size = {run.resize: run for run in sizes_of(runs, series, dataset)}
            if by_size:
                cells = tuple(_time_cell(given, number, by_size.get(s), value) for s in sizes)
                rows.append((series, next(iter(by_size.values())), cells))
    return long_table(
        given,
        rows,
        number=f"Table {number}",
        title=title,
        head=tuple(f"{size} px" if size else "as is" for size in sizes),
        definitions=meanings("t_e" if number == "7.2" else "t_m"),
    )


def _time_cell(
    given: ChapterInput, number: str, run: RunRecord | None, value: Callable[[RunRecord], float]
) -> Cell:
    if run is None:
        return Cell(NOTHING, math.nan)
    column = str(run.resize)
    thesis = given.published(number, run, column)
    if not thesis and number == "7.2" and given.is_published:
        thesis = published_value(number, published_key(run), column)
    return seconds_cell(value(run), run, f"{thesis} ms" if thesis else "")
