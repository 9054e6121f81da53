"""Chapter 6, what constant tables weigh: pictures with and without them."""

import math
from collections.abc import Iterable

from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.pictures_only import picture_runs
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_order,
    dataset_title,
    meanings,
    size_text,
)
from retraverse.studies.keeping.records import RunRecord

__all__ = ["bare_table"]


def bare_table(records: Iterable[RunRecord]) -> Table:
    """Return what a query picture weighs without what all files of its encoder share."""
    found: dict[tuple[str, int, str, int], RunRecord] = {}
    for run in picture_runs(records):
        if math.isfinite(run.query_bytes_mean) and math.isfinite(run.query_bare_bytes_mean):
            key = (run.dataset, run.resize, run.encoder, run.compression_query)
            found.setdefault(key, run)
    ordered = sorted(found, key=lambda key: (dataset_order(key[0]), *key[1:]))
    return Table(
        "",
        "Pictures without their constant tables",
        ("Dataset", "Encoder", "Size", "c", "Picture", "Without tables", "Saved"),
        tuple(_row(found[key]) for key in ordered),
        "Both ends know encoder and c, so tables that are the same in every file need not be sent. "
        "The more a picture is compressed, the larger is their share.",
        meanings("query picture", "without tables", "c"),
        lead=2,
    )


def _row(run: RunRecord) -> Row:
    whole, bare = run.query_bytes_mean, run.query_bare_bytes_mean
    saved = 1 - bare / whole if whole > 0 else math.nan
    return Row(
        (
            Cell(dataset_title(run.dataset)),
            Cell(run.encoder),
            Cell(f"{run.resize} px" if run.resize else "as is", float(run.resize or math.inf)),
            Cell(compression_text(run.compression_query), float(run.compression_query)),
            Cell(size_text(whole), whole),
            Cell(size_text(bare), bare),
            Cell(f"{100 * saved:.0f} %", saved),
        )
    )
