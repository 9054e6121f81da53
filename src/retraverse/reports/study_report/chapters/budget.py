"""Tables 4.3 and 4.4: what sequences reach in the time of the best technique without them."""

import math

from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    auc_cell,
    percent_cell,
    seconds_cell,
)
from retraverse.reports.study_report.chapters.curves import curves_by_line
from retraverse.reports.study_report.series import Runs, Series
from retraverse.reports.study_report.words import dataset_title, meanings
from retraverse.studies.judging.selection import largest_within
from retraverse.studies.keeping.records import RunRecord

__all__ = ["budget_tables"]


def budget_tables(given: ChapterInput, runs: Runs) -> list[Table]:
    """Return the table of every dataset that has single frames to set the budget."""
    return [
        table for dataset in runs.datasets if (table := _budget_table(given, runs, dataset)).rows
    ]


def _budget_table(given: ChapterInput, runs: Runs, dataset: str) -> Table:
    of_dataset = [(s, curve) for s, name, curve in curves_by_line(runs) if name == dataset]
    singles = [curve[0] for _, curve in of_dataset if curve[0].sequence_length == "1"]
    number = "4.3" if dataset in ("campus_loop", "gardens_point_day") else "4.4"
    best = max(singles, key=lambda run: run.accuracy, default=None)
    rows = []
    for series, curve in of_dataset:
        chosen = largest_within(curve, best.vpr_s) if best else None
        if chosen is not None:
            rows.append(_budget_row(given, number, series, chosen))
    for run in runs.records:
        if run.dataset == dataset and run.sequence_length == "dynamic":
            label = f"{run.technique}, dynamic K"
            rows.append(_budget_row(given, number, given.book.get(label, run.technique), run))
    budget = f"{best.technique}, {1000 * best.vpr_s:.3g} ms" if best else ""
    return Table(
        "Tables 4.3, 4.4",
        f"{dataset_title(dataset)}: largest K within the budget ({budget})",
        ("Technique", "K", "t_e × K", "t_m", "t_VPR", "Accuracy", "AUC", "P_R100"),
        tuple(rows),
        "The first K with 100 % if that is smaller; K = 1 even over the budget.",
        meanings("t_e", "t_m", "t_VPR", "accuracy", "AUC", "P_R100"),
        is_published=True,
    )


def _budget_row(given: ChapterInput, number: str, series: Series, run: RunRecord) -> Row:
    def thesis(column: str, unit: str = "") -> str:
        value = given.published(number, run, column)
        return f"{value}{unit}" if value else ""

    # A dynamic length has no single time (selection rules).
    timed = run.sequence_length != "dynamic"
    length = float(run.sequence_length) if timed else run.mean_sequence_length
    return Row(
        (
            Cell(series.label, run=run),
            Cell(run.sequence_length, length, run, thesis("K")),
            seconds_cell(run.encode_s * length if timed else math.nan, None, thesis("t_e", " s")),
            seconds_cell(run.match_s if timed else math.nan, None, thesis("t_m", " s")),
            seconds_cell(run.vpr_s if timed else math.nan, None, thesis("t_VPR", " s")),
            percent_cell(run.accuracy, None, thesis("accuracy")),
            auc_cell(run, thesis("auc")),
            percent_cell(run.p_r100, None, thesis("p_r100")),
        ),
        series.technique,
    )
