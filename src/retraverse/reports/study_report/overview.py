"""The first page: what the study says, in a few rows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from retraverse.datasets.driven_again import recorded_name
from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.words import (
    dataset_order,
    dataset_title,
    tolerance_text,
)
from retraverse.reports.wording import count
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Trouble", "datasets_table", "headline", "troubles"]


@dataclass(frozen=True)
class Trouble:
    """Runs without a result, for one and the same reason."""

    what: str
    """Technique and dataset."""
    reason: str
    n_runs: int


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
    datasets = {recorded_name(run.dataset)[0] for run in measured}
    techniques = {run.technique for run in measured}
    return (
        f"{count(len(measured), 'run')}: {count(len(techniques), 'technique')} on "
        f"{count(len(datasets), 'dataset')}"
    )
