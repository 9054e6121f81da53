"""Which part of JPEG hurts: one part of its damage at a time, against clean pictures."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.reports.study_report.artefacts import Artefact, Cell, Figure, Line, Row, Table
from retraverse.reports.study_report.chapters.beyond.chosen import settings_with
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import (
    Runs,
    Series,
    SeriesBook,
    is_whole,
    place_of,
)
from retraverse.reports.study_report.words import (
    dataset_order,
    dataset_title,
    meanings,
    measured_on,
)
from retraverse.reports.wording import NOTHING, percent, points
from retraverse.studies.keeping.records import RunRecord

__all__ = ["ALL_PARTS", "REAL_PARTS", "PartColumn", "part_artefacts", "part_columns"]

_CLEAN = "clean"
ALL_PARTS = "all of JPEG"
REAL_PARTS = frozenset({"luminance", "colour", "subsampled", "means", "details", "grid"})
"""What JPEG does, piece by piece; the other parts are what it would do without a piece."""
_MOVED_VIEW = frozenset({"cohog", "convsequential", "orb"})
"""Techniques that look for each part of a picture all over the other one."""


@dataclass(frozen=True)
class PartColumn:
    """One technique with one K on one dataset, its pictures damaged in every way."""

    series: Series
    dataset: str
    length: str
    compression: int
    """The c whose damage is divided into parts."""
    clean: RunRecord
    damaged: Mapping[str, RunRecord]
    """By name of the part; "all of JPEG" is the file as it is."""

    def change(self, part: str) -> float:
        """Return by how many points the accuracy is above that of clean pictures; NaN = none."""
        run = self.damaged.get(part)
        return math.nan if run is None else 100 * (run.accuracy - self.clean.accuracy)


def part_columns(records: Iterable[RunRecord]) -> list[PartColumn]:
    """Return what there is to compare, techniques for a moved viewpoint first."""
    files = [run for run in records if not (run.video or run.descriptor_coding)]
    groups = settings_with(files, lambda run: bool(run.jpeg_part))
    named = Runs(
        [replace(run, jpeg_part="", encoder="") for runs in groups.values() for run in runs],
        SeriesBook({}),
    )
    found = []
    for runs in groups.values():
        whole = [run for run in runs if is_whole(run) and place_of(run).is_uniform]
        for compression in sorted({run.compression_query for run in runs if run.jpeg_part}):
            clean = min(whole, key=lambda run: run.compression_query, default=None)
            if clean is not None and clean.compression_query < compression:
                series = named.series_of(clean)
                found.append(_column(series, clean, runs, compression))
    return sorted(found, key=_order)


def _column(
    series: Series, clean: RunRecord, runs: Sequence[RunRecord], compression: int
) -> PartColumn:
    damaged = {
        run.jpeg_part or ALL_PARTS: run
        for run in runs
        if run.compression_query == run.compression_reference == compression
    }
    ordered = sorted(damaged, key=_part_order)
    return PartColumn(
        series,
        clean.dataset,
        clean.sequence_length,
        compression,
        clean,
        {name: damaged[name] for name in ordered},
    )


def _part_order(name: str) -> tuple[int, str]:
    names = [ALL_PARTS, *JPEG_PARTS]
    return names.index(name) if name in names else len(names), name


def _order(column: PartColumn) -> tuple[object, ...]:
    return (
        column.compression,
        dataset_order(column.dataset),
        _length_order(column.length),
        column.series.technique not in _MOVED_VIEW,
        column.series,
    )


def _length_order(length: str) -> tuple[bool, int]:
    return (False, int(length)) if length.isdigit() else (True, 0)


def part_artefacts(records: Iterable[RunRecord]) -> tuple[Artefact, ...]:
    """Return, for each c, the mean over the datasets, then a table for each dataset."""
    columns = part_columns(records)
    found: list[Artefact] = []
    for compression in sorted({column.compression for column in columns}):
        here = [column for column in columns if column.compression == compression]
        datasets = sorted({column.dataset for column in here}, key=dataset_order)
        found.append(_figure(here, datasets))
        found += [_table(here, datasets)] if len(datasets) > 1 else []
        found += [_table(here, [dataset]) for dataset in datasets]
    return tuple(found)


Alike = Mapping[str, Mapping[Series, Sequence[PartColumn]]]
"""Columns by K, then by technique: one for each dataset."""


def _alike(columns: Iterable[PartColumn], datasets: Sequence[str]) -> Alike:
    """Return the columns of some datasets; a technique that missed one of them is left out."""
    found: dict[str, dict[Series, list[PartColumn]]] = {}
    for column in columns:
        if column.dataset in datasets:
            found.setdefault(column.length, {}).setdefault(column.series, []).append(column)
    return {
        length: {series: some for series, some in of.items() if len(some) == len(datasets)}
        for length, of in found.items()
    }


def _mean(values: Iterable[float]) -> float:
    """Return the mean, NaN if one of the values does not exist."""
    found = list(values)
    return sum(found) / len(found) if found else math.nan


def _table(columns: Sequence[PartColumn], datasets: Sequence[str]) -> Table:
    alike = _alike(columns, datasets)
    techniques = list(dict.fromkeys(series for of in alike.values() for series in of))
    rows = [
        _row(part, length, of, techniques)
        for length, of in alike.items()
        for part in (_CLEAN, *_parts(of))
    ]
    return Table(
        "",
        f"One part of JPEG at c = {columns[0].compression}: {_where(datasets)}",
        ("Part", "What is done", "K", *(series.label for series in techniques)),
        tuple(rows),
        f"{_caption(techniques)} {_measured(columns, datasets)}".strip(),
        meanings("accuracy", "change", "K", "c"),
        lead=3,
    )


def _where(datasets: Sequence[str]) -> str:
    if len(datasets) > 1:
        return f"mean of {len(datasets)} datasets"
    return dataset_title(datasets[0])


def _measured(columns: Iterable[PartColumn], datasets: Sequence[str]) -> str:
    if len(datasets) > 1:
        return "Every dataset counts once."
    return f"{measured_on(next(one.clean for one in columns if one.dataset == datasets[0]))}."


def _parts(of: Mapping[Series, Sequence[PartColumn]]) -> list[str]:
    return sorted(
        {part for some in of.values() for one in some for part in one.damaged}, key=_part_order
    )


def _row(
    part: str,
    length: str,
    of: Mapping[Series, Sequence[PartColumn]],
    techniques: Sequence[Series],
) -> Row:
    return Row(
        (
            Cell(part),
            Cell(_summary(part)),
            Cell(length, float(length) if length.isdigit() else math.inf),
            *(_cell(part, of.get(series, ())) for series in techniques),
        )
    )


def _summary(part: str) -> str:
    if part == _CLEAN:
        return "nothing: what the others are compared with"
    if part == ALL_PARTS:
        return "the JPEG file as it is"
    known = JPEG_PARTS.get(part)
    return "" if known is None else known.summary


def _cell(part: str, columns: Sequence[PartColumn]) -> Cell:
    runs = [one.clean if part == _CLEAN else one.damaged.get(part) for one in columns]
    accuracy = _mean(math.nan if run is None else run.accuracy for run in runs)
    if math.isnan(accuracy):
        return Cell(NOTHING, math.nan)
    change = _mean(one.change(part) for one in columns)
    return Cell(
        percent(accuracy),
        accuracy,
        # A mean is of several runs and leads to none.
        runs[0] if len(runs) == 1 else None,
        note="" if part == _CLEAN else f"({points(change)})",
    )


def _caption(techniques: Iterable[Series]) -> str:
    names = sorted({series.technique for series in techniques})
    moved = [name for name in names if name in _MOVED_VIEW]
    fixed = [name for name in names if name not in _MOVED_VIEW]
    said = "Accuracy; in brackets its change in points against clean pictures, query and map alike."
    if moved:
        said += f" Compared across viewpoints: {', '.join(moved)}."
    if fixed:
        said += f" Wanting the same viewpoint: {', '.join(fixed)}."
    return said


def _figure(columns: Sequence[PartColumn], datasets: Sequence[str]) -> Figure:
    panels = []
    for length, of in _alike(columns, datasets).items():
        parts = _parts(of)
        lines = [
            Line(
                series,
                tuple(map(float, range(len(parts)))),
                tuple(_mean(one.change(part) for one in some) for part in parts),
                tuple(some[0].damaged.get(part) if len(some) == 1 else None for part in parts),
            )
            for series, some in of.items()
        ]
        panels.append(
            draw_lines(
                f"K = {length}" if length.isdigit() else f"{length} K",
                _where(datasets),
                lines,
                name="parts of JPEG",
                x_label="",
                y_label="Change of accuracy, points",
                x_ticks=parts,
                is_joined=False,
            )
        )
    return Figure(
        "",
        f"What each part of JPEG at c = {columns[0].compression} does to the accuracy",
        tuple(panels),
        "Against clean pictures, query and map alike; below 0 accuracy is lost.",
        meanings("accuracy", "change", "K", "c"),
    )
