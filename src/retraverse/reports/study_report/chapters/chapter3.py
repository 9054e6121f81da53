"""Chapter 3: sequences whose length follows the information in the pictures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from retraverse.metrics import precision_recall_curve
from retraverse.reports.study_report.artefacts import Chapter, Figure, Line, Section, Table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    auc_cell,
    long_table,
    percent_cell,
)
from retraverse.reports.study_report.chapters.regions import region_galleries
from retraverse.reports.study_report.chapters.sheets import match_sheets
from retraverse.reports.study_report.figures import (
    PERCENT,
    accuracy_percent,
    first_run,
    over_length,
    plainest,
    side_by_side,
)
from retraverse.reports.study_report.panels import draw_bars, draw_lines
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import dataset_title, meanings, measured_on
from retraverse.reports.wording import plain, ratio
from retraverse.studies.judging.selection import per_compute_unit
from retraverse.studies.keeping.records import RunRecord

__all__ = ["chapter_3", "precision_recall_figure"]

_LENGTHS = ("10", "dynamic")
"""The sequence lengths that stand for a technique with many (selection rules)."""


def chapter_3(given: ChapterInput) -> Chapter:
    """Return the page of chapter 3."""
    headlines = _headlines(given)
    return Chapter(
        "3",
        "Sequences of fixed and dynamic length",
        "Is a sequence matcher with handcrafted features as good as learned techniques, and what "
        "does a length buy that follows the pictures?",
        (
            Section(
                "How often is the answer right?",
                (
                    side_by_side(
                        headlines,
                        accuracy_percent,
                        number="Figure 3.4",
                        title="Accuracy of every technique",
                        x_label="Accuracy, %",
                        caption="Bars: 95 % intervals.",
                        definitions=meanings("accuracy", "interval"),
                        with_interval=True,
                    ),
                    _quality_table(given, headlines),
                    precision_recall_figure(given, headlines),
                ),
            ),
            Section(
                "What does it cost?",
                (
                    side_by_side(
                        headlines,
                        lambda run: per_compute_unit(run, _same_dataset(headlines, run)),
                        number="Figure 3.6",
                        title="Precision per compute unit",
                        x_label="PCU",
                        definitions=meanings("PCU", "P_R100", "t_e"),
                    ),
                    side_by_side(
                        headlines,
                        lambda run: 1000 * run.encode_s,
                        number="Figure 3.7",
                        title="Encoding time of one picture",
                        x_label="t_e, ms",
                        definitions=meanings("t_e"),
                        is_log=True,
                    ),
                ),
            ),
            Section("What does the length do?", tuple(_length_figures(given, headlines))),
            Section("Where does it look?", region_galleries(given)),
            Section(
                "Right and wrong, in pictures",
                match_sheets(given, headlines.records, number="Figures 3.11, 3.12"),
            ),
        ),
        given.records,
    )


def _headlines(given: ChapterInput) -> Runs:
    sequence = [run for run in given.records if run.technique == "convsequential"]
    others = [run for run in given.records if run.technique != "convsequential"]
    chosen = [run for run in sequence if run.sequence_length in _LENGTHS] or sequence
    kept = ChapterInput("3", tuple(others), given.in_full, given.book).headlines().records
    return Runs([*chosen, *kept], given.book, over_length=False)


def _same_dataset(runs: Runs, run: RunRecord) -> list[RunRecord]:
    return [other for other in runs.records if other.dataset == run.dataset]


def _one_each(runs: Runs) -> list[tuple[Series, RunRecord]]:
    """Return the run that stands for every line on every dataset."""
    found = []
    for dataset in runs.datasets:
        for series in runs.series:
            place = plainest(runs.places_of(series, dataset))
            run = first_run(runs.at(series, dataset, place)) if place else None
            if run is not None:
                found.append((series, run))
    return found


def _quality_table(given: ChapterInput, headlines: Runs) -> Table:
    rows = [
        (
            series,
            run,
            (
                percent_cell(run.accuracy),
                auc_cell(run, given.published("3.1", run, run.dataset)),
                percent_cell(run.p_r100),
                percent_cell(run.r_p100),
            ),
        )
        for series, run in _one_each(headlines)
    ]
    return long_table(
        given,
        rows,
        number="Table 3.1",
        title="Area under the precision-recall curve, and what belongs to it",
        head=("Accuracy", "AUC", "P_R100", "R_P100"),
        caption="AUC of 1: some score parts all right answers from all wrong ones.",
        definitions=meanings("accuracy", "AUC", "P_R100", "R_P100"),
    )


def precision_recall_figure(given: ChapterInput, headlines: Runs) -> Figure:
    """Return the precision-recall curves, one panel for each dataset."""
    chosen = _one_each(headlines)
    full = given.in_full([run for _, run in chosen])
    panels = []
    for dataset in headlines.datasets:
        lines = [
            line
            for (series, run), whole in zip(chosen, full, strict=True)
            if run.dataset == dataset and (line := _curve(series, run, whole)) is not None
        ]
        if lines:
            record = next(run for _, run in chosen if run.dataset == dataset)
            panels.append(
                draw_lines(
                    dataset_title(dataset),
                    measured_on(record),
                    lines,
                    name="precision and recall",
                    x_label="Recall",
                    y_label="Precision",
                    y_limits=(0, 1.03),
                )
            )
    return Figure(
        "Figure 3.5",
        "Precision and recall",
        tuple(panels),
        "Accepting only answers above a falling score: the share of accepted answers that are "
        "right, over the share of right answers found. Curves that stay at the top are best.",
        meanings("AUC"),
    )


def _curve(series: Series, run: RunRecord, whole: RunRecord) -> Line | None:
    answered = np.asarray(whole.answer_reference) >= 0
    score = np.asarray(whole.answer_score, np.float64)[answered]
    if not score.size or not np.isfinite(score).all():
        return None
    curve = precision_recall_curve(np.asarray(whole.answer_correct)[answered], score)
    at = _corners(curve.recall, curve.precision)
    return Line(
        series,
        tuple(float(curve.recall[i]) for i in at),
        tuple(float(curve.precision[i]) for i in at),
        (run,) * len(at),
    )


def _corners(recall: np.ndarray, precision: np.ndarray, most: int = 60) -> list[int]:
    """Return at most `most` points that keep the curve's course, its ends among them."""
    if len(recall) <= most:
        return list(range(len(recall)))
    travelled = np.cumsum(np.hypot(np.diff(recall, prepend=0), np.diff(precision, prepend=1)))
    wanted = np.linspace(0, travelled[-1], most)
    return sorted(
        {0, len(recall) - 1, *np.searchsorted(travelled, wanted).clip(max=len(recall) - 1).tolist()}
    )


def _length_figures(given: ChapterInput, headlines: Runs) -> Sequence[Figure]:
    dynamic = [
        (series, run) for series, run in _one_each(headlines) if run.sequence_length == "dynamic"
    ]
    swept = [run for run in given.records if run.technique == "convsequential"]
    over = Runs(swept or given.records, given.book)
    return [
        _histograms(given, dynamic),
        over_length(
            over,
            accuracy_percent,
            number="Figure 3.9",
            title="Accuracy for every fixed length",
            y_label="Accuracy, %",
            caption="The same similarity matrix, matched with every K.",
            definitions=meanings("accuracy", "K"),
            longest=20,
            y_limits=PERCENT,
        ),
        over_length(
            over,
            lambda run: run.auc,
            number="Figure 3.10",
            title="AUC for every fixed length",
            y_label="AUC",
            definitions=meanings("AUC", "K"),
            longest=20,
            y_limits=(0, 1.03),
        ),
    ]


def _histograms(given: ChapterInput, dynamic: Sequence[tuple[Series, RunRecord]]) -> Figure:
    full = given.in_full([run for _, run in dynamic])
    panels = []
    for (series, run), whole in zip(dynamic, full, strict=True):
        lengths, counts = np.unique(np.asarray(whole.sequence_lengths, int), return_counts=True)
        if not len(lengths):
            continue
        line = Line(
            replace(series),
            tuple(float(length) for length in lengths),
            tuple(float(count) for count in counts),
            (run,) * len(lengths),
        )
        panels.append(
            draw_bars(
                dataset_title(run.dataset),
                f"{measured_on(run)}; mean K {plain(run.mean_sequence_length)}, "
                f"AUC {ratio(run.auc)}",
                line,
                name=f"lengths {series.label}",
                x_label="Sequence length K, frames",
                y_label="Windows",
                mean=run.mean_sequence_length,
            )
        )
    return Figure(
        "Figure 3.8",
        "Lengths that the dynamic rule chose",
        tuple(panels),
        "Dashed: the mean. A window grows while its pictures tell little or look alike.",
        meanings("K"),
    )
