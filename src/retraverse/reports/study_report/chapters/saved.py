"""Chapter 6, what compression saves: bytes of an answer at equal accuracy."""

import math

from retraverse.reports.study_report.artefacts import Cell, Table
from retraverse.reports.study_report.chapters.context import (
    ChapterInput,
    long_table,
    whole_cell,
)
from retraverse.reports.study_report.series import Runs
from retraverse.reports.study_report.words import meanings, size_text
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.saving import Saving, savings
from retraverse.studies.keeping.records import RunRecord

__all__ = ["SENT_AT", "savings_table"]

SENT_AT = 95
"""c of the pictures that are sent; the thesis' own finding is that up to there little is lost."""


def savings_table(given: ChapterInput, runs: Runs) -> Table:
    """Return clean pictures, descriptors and compressed pictures side by side."""
    found = savings(runs.records, compression=SENT_AT)
    rows = [(runs.series_of(saving.clean), saving.clean, _cells(saving)) for saving in found]
    return long_table(
        given,
        rows,
        number="",
        title=f"What c = {SENT_AT} saves at equal accuracy",
        head=(
            "K, clean",
            "Accuracy, clean",
            f"K, c = {SENT_AT}",
            f"Accuracy, c = {SENT_AT}",
            "Clean pictures",
            "Descriptors",
            f"Pictures, c = {SENT_AT}",
            "Saved against pictures",
            "Saved against descriptors",
            "A frame: clean / descriptor / compressed",
        ),
        caption=f"The shortest window of pictures at c = {SENT_AT} that is as accurate as K clean "
        "ones, and the bytes of an answer that starts from nothing. A robot on its way sends only "
        "its newest frame, whatever K is: the last column. Below 0 % compression costs bytes. "
        "Accuracy with its 95 % interval.",
        definitions=meanings("accuracy", "interval", "d", "descriptor size", "K", "c"),
    )


def _cells(saving: Saving) -> tuple[Cell, ...]:
    chosen = saving.compressed
    return (
        whole_cell(float(saving.clean.sequence_length), saving.clean),
        _accuracy(saving.clean),
        Cell("none", math.inf) if chosen is None else _length(chosen),
        Cell(NOTHING, math.nan) if chosen is None else _accuracy(chosen),
        _bytes(saving.clean_bytes),
        _bytes(saving.descriptor_bytes),
        _bytes(saving.compressed_bytes),
        _saved(saving.compressed_bytes, saving.clean_bytes),
        _saved(saving.compressed_bytes, saving.descriptor_bytes),
        Cell(" / ".join(_size(value) for value in saving.frame_bytes), saving.frame_bytes[2]),
    )


def _length(run: RunRecord) -> Cell:
    return whole_cell(float(run.sequence_length), run)


def _accuracy(run: RunRecord) -> Cell:
    interval = f"{100 * run.accuracy_low:.0f} to {100 * run.accuracy_high:.0f}"
    return Cell(f"{100 * run.accuracy:.1f} %", run.accuracy, run, note=interval)


def _bytes(value: float) -> Cell:
    return Cell(_size(value), value)


def _size(value: float) -> str:
    return size_text(value) if math.isfinite(value) else NOTHING


def _saved(ours: float, theirs: float) -> Cell:
    """Return the share of the other's bytes that is not sent."""
    if not (math.isfinite(ours) and theirs > 0):
        return Cell(NOTHING, math.nan)
    share = 1 - ours / theirs
    return Cell(f"{100 * share:,.0f} %", share)
