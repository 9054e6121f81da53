"""The first page: what the study says, in a few rows."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.words import (
    dataset_order,
    dataset_title,
    meanings,
    place_text,
    size_text,
    tolerance_text,
)
from retraverse.reports.wording import NOTHING, count, percent, seconds
from retraverse.studies.records import RunRecord
from retraverse.studies.selection import (
    curves_of,
    data_per_answer,
    smallest_length,
)

__all__ = ["Trouble", "best_table", "datasets_table", "headline", "troubles"]


@dataclass(frozen=True)
class Trouble:
    """Runs without a result, for one and the same reason."""

    what: str
    """Technique and dataset."""
    reason: str
    n_runs: int


def best_table(records: Sequence[RunRecord]) -> Table:
    """Return, for every dataset, the runs to begin a choice with."""
    curves = list(curves_of(records).values())
    rows = []
    for dataset in sorted(
        {run.dataset for run in records if run.status == "ok"}, key=dataset_order
    ):
        here = [curve for curve in curves if curve[0].dataset == dataset]
        full = [s.first for curve in here if (s := smallest_length(curve)) is not None]
        singles = [curve[0] for curve in here if curve[0].sequence_length == "1"]
        rows.append(
            Row(
                (
                    Cell(dataset_title(dataset)),
                    _best(singles, lambda run: -run.accuracy, lambda run: percent(run.accuracy)),
                    _best(
                        full,
                        lambda run: float(run.sequence_length),
                        lambda run: f"K = {run.sequence_length}",
                    ),
                    _best(full, data_per_answer, lambda run: size_text(data_per_answer(run))),
                    _best(full, lambda run: run.vpr_s, lambda run: seconds(run.vpr_s)),
                )
            )
        )
    return Table(
        "",
        "Where to begin",
        (
            "Dataset",
            "Most accurate single frame",
            "100 % with the shortest sequence",
            "100 % with the fewest bytes",
            "100 % in the least time",
        ),
        tuple(rows),
        "Each is the best of all runs of the study, which flatters it. A click opens the run. "
        "Fewer than some twenty candidates left make 100 % easy: see the chapters' tables.",
        meanings("accuracy", "smallest K", "d", "t_VPR"),
    )


def _best(
    runs: Iterable[RunRecord],
    cost: Callable[[RunRecord], float],
    write: Callable[[RunRecord], str],
) -> Cell:
    """Return the run of least cost in words; NaN is no cost."""
    known = [(cost(run), at, run) for at, run in enumerate(runs) if math.isfinite(cost(run))]
    if not known:
        return Cell(NOTHING, math.nan)
    value, _, run = min(known)
    return Cell(write(run), value, run, note=_mix(run))


def _mix(run: RunRecord) -> str:
    length = "" if run.sequence_length == "1" else f", K = {run.sequence_length}"
    place = place_text(run)
    return f"{run.technique}{length}" + ("" if place.startswith("pictures") else f", {place}")


def datasets_table(records: Sequence[RunRecord], absent: Iterable[str]) -> Table:
    """Return what every dataset is and how its answers were judged."""
    rows = []
    for dataset in sorted({run.dataset for run in records}, key=dataset_order):
        runs = [run for run in records if run.dataset == dataset and run.status == "ok"]
        if runs:
            first = runs[0]
            cells = (
                Cell(dataset_title(dataset)),
                Cell(f"{first.n_queries:,}", first.n_queries),
                Cell(f"{first.n_references:,}", first.n_references),
                Cell(tolerance_text(first)),
                Cell(f"{len(runs):,}", len(runs)),
            )
            rows.append(Row(cells))
    rows += [Row((Cell(dataset_title(name)),), absent="dataset not here") for name in absent]
    return Table(
        "",
        "Datasets",
        ("Dataset", "Query frames", "Map frames", "Right within", "Runs"),
        tuple(rows),
    )


def troubles(records: Iterable[RunRecord]) -> list[Trouble]:
    """Return the runs without a result, grouped by reason."""
    groups: dict[tuple[str, str], set[str]] = {}
    for run in records:
        if run.status != "ok":
            what = f"{run.technique} on {dataset_title(run.dataset)}"
            reason = run.error or run.status
            groups.setdefault((what, reason), set()).add(run.run_id)
    return [Trouble(what, reason, len(ids)) for (what, reason), ids in sorted(groups.items())]


def headline(records: Sequence[RunRecord]) -> str:
    """Return what the study is, in one line."""
    measured = [run for run in records if run.status == "ok"]
    datasets = {run.dataset for run in measured}
    techniques = {run.technique for run in measured}
    return (
        f"{count(len(measured), 'run')}: {count(len(techniques), 'technique')} on "
        f"{count(len(datasets), 'dataset')}"
    )
