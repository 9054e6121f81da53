"""A page for any grid: figures along the axes that a plan varies, and a table of its runs."""

from retraverse.reports.study_report.artefacts import Artefact, Cell, Chapter, Section, Table
from retraverse.reports.study_report.chapters.chapter4 import smallest_table
from retraverse.reports.study_report.chapters.chapter5 import non_uniform_figures
from retraverse.reports.study_report.chapters.chapter7 import time_figure
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    auc_cell,
    long_table,
    percent_cell,
    seconds_cell,
)
from retraverse.reports.study_report.chapters.data_of_answers import data_figure
from retraverse.reports.study_report.figures import (
    PERCENT,
    accuracy_percent,
    over_compression,
    over_length,
    over_size,
    side_by_side,
)
from retraverse.reports.study_report.series import Runs
from retraverse.reports.study_report.words import (
    compression_text,
    length_words,
    meanings,
    size_text,
)
from retraverse.studies.judging.selection import data_per_answer, length_of

__all__ = ["free_plan", "free_sections"]

_MOST_ROWS = 1500
"""Runs that the table of all runs shows at most; the exported one has them all."""


def free_plan(given: ChapterInput) -> Chapter:
    """Return the page of a plan that is no chapter of the thesis."""
    return Chapter(
        "runs",
        "The runs of this plan",
        "Which technique, picture quality, size and sequence length are accurate, small and fast "
        "enough?",
        free_sections(given),
        given.records,
    )


def free_sections(given: ChapterInput) -> tuple[Section, ...]:
    """Return sections along whatever axes the records have."""
    over, headlines = given.over_length, given.headlines()
    lengths = {length_of(run) for run in over.records} - {None}
    quality: list[Artefact] = []
    if len(lengths) > 1:
        quality.append(
            over_length(
                over,
                accuracy_percent,
                number="",
                title="Accuracy over sequence length",
                y_label="Accuracy, %",
                caption="Pictures as little worsened as the plan has them.",
                definitions=meanings("accuracy", "K"),
                y_limits=PERCENT,
            )
        )
        quality.append(smallest_table(given, over, number=""))
    if len({place.compression_query for place in over.places if place.is_uniform}) > 1:
        quality.append(_compressed(headlines))
    quality += non_uniform_figures(headlines, ("", ""))
    if len({place.resize for place in over.places}) > 1:
        quality.append(_sized(headlines))
    if not quality:
        quality.append(
            side_by_side(
                headlines,
                accuracy_percent,
                number="",
                title="Accuracy of every technique",
                x_label="Accuracy, %",
                definitions=meanings("accuracy", "interval"),
                with_interval=True,
            )
        )
    return (
        Section("What is accurate?", tuple(quality)),
        Section("What does it cost?", (data_figure(over), *_time(headlines))),
        Section("Every run", (_all_runs(given, headlines),)),
    )


def _compressed(runs: Runs) -> Artefact:
    return over_compression(
        runs,
        accuracy_percent,
        number="",
        title="Accuracy over compression",
        y_label="Accuracy, %",
        definitions=meanings("accuracy", "interval", "c"),
        y_limits=PERCENT,
        with_interval=True,
    )


def _sized(runs: Runs) -> Artefact:
    return over_size(
        runs,
        accuracy_percent,
        number="",
        title="Accuracy over picture size",
        y_label="Accuracy, %",
        definitions=meanings("accuracy", "interval"),
        y_limits=PERCENT,
        with_interval=True,
    )


def _time(headlines: Runs) -> tuple[Artefact, ...]:
    figure = time_figure(headlines, number="")
    return (figure,) if figure.panels else ()


def _all_runs(given: ChapterInput, headlines: Runs) -> Table:
    rows = []
    for series in headlines.series:
        for dataset in headlines.datasets:
            for place in headlines.places_of(series, dataset):
                for run in headlines.at(series, dataset, place):
                    data = data_per_answer(run)
                    cells = (
                        Cell(length_words(run), run.mean_sequence_length),
                        Cell(place.query_text, run.compression_query),
                        Cell(
                            compression_text(run.compression_reference), run.compression_reference
                        ),
                        Cell(f"{run.resize} px" if run.resize else "as is", run.resize),
                        percent_cell(run.accuracy),
                        auc_cell(run),
                        seconds_cell(run.vpr_s),
                        Cell(size_text(data), data),
                    )
                    rows.append((series, run, cells))
    return long_table(
        given,
        rows[:_MOST_ROWS],
        number="",
        title="Runs" if len(rows) <= _MOST_ROWS else f"The first {_MOST_ROWS:,} runs",
        head=("K", "c query", "c map", "Size", "Accuracy", "AUC", "t_VPR", "d"),
        caption="Of techniques with many K, single frames and dynamic lengths; the others are a "
        "click away.",
        definitions=meanings("accuracy", "AUC", "t_VPR", "d"),
    )
