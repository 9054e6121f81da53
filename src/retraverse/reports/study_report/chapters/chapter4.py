"""Chapter 4: what sequences add to any technique, and what they cost."""

import math
from collections.abc import Sequence

from retraverse.reports.study_report.artefacts import (
    Artefact,
    Cell,
    Chapter,
    Section,
    Table,
)
from retraverse.reports.study_report.chapters.budget import budget_tables
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    long_table,
    percent_cell,
    published_key,
    seconds_cell,
    whole_cell,
)
from retraverse.reports.study_report.chapters.curves import curves_by_line, fixed_curve
from retraverse.reports.study_report.chapters.sheets import match_sheets
from retraverse.reports.study_report.figures import (
    accuracy_percent,
    over_length,
    scattered,
)
from retraverse.reports.study_report.published import published_value
from retraverse.reports.study_report.series import Runs
from retraverse.reports.study_report.words import dataset_title, meanings
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.selection import (
    boost,
    length_of,
    per_compute_unit,
    smallest_length,
)
from retraverse.studies.keeping.records import RunRecord

__all__ = ["chapter_4", "smallest_table"]


def chapter_4(given: ChapterInput) -> Chapter:
    """Return the page of chapter 4."""
    runs = given.over_length
    return Chapter(
        "4",
        "Sequences on top of any technique",
        "How many frames must be matched together until every answer is right, and is a simple "
        "technique with a long sequence better than a strong one with single frames?",
        (
            Section("How much do sequences help?", _help(given, runs)),
            Section("What do they cost?", _costs(given, runs)),
            Section(
                "In the time of the best technique without sequences",
                tuple(budget_tables(given, runs)),
                "The budget is t_VPR of the technique that is most accurate at K = 1.",
            ),
            Section(
                "Right and wrong, in pictures",
                match_sheets(given, _middling(runs), number="Figures 4.5, 4.6"),
            ),
        ),
        given.records,
    )


def _middling(runs: Runs) -> list[RunRecord]:
    """Return the runs of some five frames: long enough to help, short enough to go wrong."""
    lengths = {length for run in runs.records if (length := length_of(run)) is not None}
    middle = min(lengths, key=lambda length: abs(length - 5), default=None)
    return runs.where(lambda run: length_of(run) == middle)


def _until_full(curve: Sequence[RunRecord]) -> int | None:
    """Return the smallest K with 100 %, where figures of the thesis end; None if it is not."""
    smallest = smallest_length(tuple(curve))
    return None if smallest is None else int(smallest.first.sequence_length)


def _boosts(runs: Runs) -> dict[str, float]:
    return {
        run.run_id: math.nan if value is None else value
        for _, _, curve in curves_by_line(runs)
        for run, (_, value) in zip(curve, boost(curve), strict=False)
    }


def _help(given: ChapterInput, runs: Runs) -> tuple[Artefact, ...]:
    boosts = _boosts(runs)
    singles = {
        (run.dataset, series): run.accuracy
        for series, _, curve in curves_by_line(runs)
        for run in curve
        if run.sequence_length == "1"
    }
    undefined = [
        f"{series.label} on {dataset_title(dataset)}"
        for (dataset, series), accuracy in singles.items()
        if accuracy == 0
    ]
    return (
        over_length(
            runs,
            accuracy_percent,
            number="",
            title="Accuracy over sequence length",
            y_label="Accuracy, %",
            definitions=meanings("accuracy", "K"),
        ),
        smallest_table(given, runs, number="Table 4.1"),
        over_length(
            runs,
            lambda run: boosts.get(run.run_id, math.nan),
            number="Figure 4.3",
            title="Gain over single frames",
            y_label="Gain, %",
            caption="Drawn up to the smallest K with 100 %."
            + (f" Undefined, as a_1 = 0: {'; '.join(undefined)}." if undefined else ""),
            definitions=meanings("boost"),
            until=_until_full,
        ),
        scattered(
            runs,
            lambda series, dataset: _against_single(
                fixed_curve(runs, series, dataset), singles.get((dataset, series), math.nan)
            ),
            number="Figure 4.4",
            title="Sequence against single frame",
            x_label="Accuracy at K = 1, %",
            y_label="Accuracy with sequences, %",
            caption="One column of points is one technique; each point is one K.",
            definitions=meanings("accuracy"),
        ),
    )


def _against_single(
    curve: Sequence[RunRecord], single: float
) -> list[tuple[float, float, RunRecord]]:
    """Return some twelve of a curve's runs as points over the accuracy of single frames."""
    step = max(1, len(curve) // 12)
    return [(100 * single, 100 * run.accuracy, run) for run in curve[::step]]


def smallest_table(given: ChapterInput, runs: Runs, *, number: str) -> Table:
    """Return the smallest K with 100 % of every line and dataset, and what it leaves."""
    rows = []
    for series, dataset, curve in curves_by_line(runs):
        smallest = smallest_length(curve)
        first = smallest.first if smallest else None
        stays = smallest.stays if smallest else None
        best = max(curve, key=lambda run: run.accuracy)
        shown = first or best
        thesis = (
            given.published("4.1", shown, dataset, row=published_key(curve[0])) if number else ""
        )
        rows.append(
            (
                series,
                shown,
                (
                    percent_cell(curve[0].accuracy, curve[0])
                    if curve[0].sequence_length == "1"
                    else Cell(NOTHING, math.nan),
                    Cell(
                        first.sequence_length if first else "none",
                        float(first.sequence_length) if first else math.inf,
                        first,
                        thesis,
                        ""
                        if first
                        else f"best {100 * best.accuracy:.1f} % at K = {best.sequence_length}",
                    ),
                    whole_cell(float(stays.sequence_length) if stays else None),
                    whole_cell(first.n_windows if first else None),
                    whole_cell(first.n_candidates if first else None),
                ),
            )
        )
    return long_table(
        given,
        rows,
        number=number,
        title="Smallest K with 100 % accuracy",
        head=("Accuracy at K = 1", "Smallest K", "Stays from K", "Windows left", "Candidates left"),
        caption="Few candidates left: the map hardly offers a wrong answer any more.",
        definitions=meanings("smallest K"),
    )


def _costs(given: ChapterInput, runs: Runs) -> tuple[Artefact, ...]:
    return (
        encoding_table(given, runs, number="4.2"),
        over_length(
            runs,
            lambda run: 1000 * run.match_s,
            number="Figure 4.7",
            title="Matching time of one window",
            y_label="t_m, ms",
            caption="Drawn up to the smallest K with 100 %.",
            definitions=meanings("t_m"),
            until=_until_full,
            is_log=True,
        ),
        over_length(
            runs,
            lambda run: per_compute_unit(
                run, [other for other in runs.records if other.dataset == run.dataset]
            ),
            number="Figure 4.8",
            title="Precision per compute unit",
            y_label="PCU",
            caption="Drawn up to the smallest K with 100 %.",
            definitions=meanings("PCU", "P_R100", "t_e"),
            until=_until_full,
        ),
    )


def encoding_table(given: ChapterInput, runs: Runs, *, number: str) -> Table:
    """Return t_e and descriptor size of every technique, a row for each dataset."""
    rows = []
    for series, _, curve in curves_by_line(runs):
        run = curve[0]
        thesis = published_value(number, published_key(run), "any") if given.is_published else ""
        rows.append(
            (
                series,
                run,
                (
                    seconds_cell(run.encode_s, run, f"{thesis} s" if thesis else ""),
                    whole_cell(run.descriptor_dimension),
                ),
            )
        )
    return long_table(
        given,
        rows,
        number=f"Table {number}",
        title="Encoding time of one picture",
        head=("t_e", "Numbers in the descriptor"),
        caption="Ours on the machine of the run's provenance; the thesis' on an Intel i7-4790K.",
        definitions=meanings("t_e"),
    )
