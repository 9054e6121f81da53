"""Records without their long columns: what tables and figures of a large study are drawn from.

A study of a hundred thousand runs holds answers for every window of every run. Reading them all
takes gigabytes; the numbers alone take little, and the answers of a few runs are read when asked.

Conventions: as `retraverse.studies.keeping.records`. A column that was not read has its default.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from retraverse.errors import DataMissingError, InputError
from retraverse.studies.keeping.records import NEEDED_COLUMNS, RunRecord, record_files

__all__ = ["LONG_COLUMNS", "read_light_records", "study_folders", "with_long_columns"]

LONG_COLUMNS = (
    "sequence_lengths",
    "answer_query",
    "answer_reference",
    "answer_score",
    "answer_correct",
    "provenance",
)
"""Fields of a `RunRecord` that `read_light_records` leaves at their defaults."""

_light = tuple(field.name for field in fields(RunRecord) if field.name not in LONG_COLUMNS)
_defaults = {field.name: field.default for field in fields(RunRecord)}
_at_once = 500
"""Runs whose long columns are asked for in one question to the database."""


def study_folders(path: Path) -> tuple[Path, ...]:
    """Return the studies in a folder: itself, or, of several plans, its sub-folders by name.

    Raises
    ------
    DataMissingError
        If there are no records in either.
    """
    if (path / "records").is_dir():
        return (path,)
    found = tuple(sorted(folder.parent for folder in path.glob("*/records") if folder.is_dir()))
    if not found:
        raise DataMissingError(f"{path}: no study here, expected a folder with records in it")
    return found


def read_light_records(studies: Sequence[Path]) -> tuple[RunRecord, ...]:
    """Return the records of some studies' folders without `LONG_COLUMNS`.

    A run that was repeated (a resumed study) counts once: the last of it that has a result.

    Raises
    ------
    InputError
        If a file holds no study records, or is damaged.
    """
    found: dict[tuple[str, str], RunRecord] = {}
    for row in _rows(studies, _light, ""):
        record = _record(_light, row)
        key = (record.chapter, record.run_id)
        if key not in found or record.status == "ok":
            found[key] = record
    return tuple(found.values())


def with_long_columns(
    studies: Sequence[Path], records: Sequence[RunRecord]
) -> tuple[RunRecord, ...]:
    """Return these records, read by `read_light_records`, with all their columns.

    Raises
    ------
    InputError
        If a file holds no study records, or is damaged.
    """
    columns = ("run_id", "chapter", *LONG_COLUMNS)
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for start in range(0, len(records), _at_once):
        wanted = [record.run_id for record in records[start : start + _at_once]]
        for row in _rows(studies, columns, "WHERE run_id IN (SELECT unnest(?))", [wanted]):
            values = dict(zip(columns, row, strict=True))
            found[values["chapter"], values["run_id"]] = {
                name: _value(name, values[name]) for name in LONG_COLUMNS
            }
    return tuple(
        replace(record, **found.get((record.chapter, record.run_id), {})) for record in records
    )


def _rows(
    studies: Sequence[Path], columns: Iterable[str], where: str, values: Sequence[Any] = ()
) -> list[tuple[Any, ...]]:
    import duckdb

    files = [str(path) for study in studies for path in record_files(study / "records")]
    if not files:
        return []
    settings: dict[str, Any] = {"threads": 1, "autoload_known_extensions": False}
    try:
        with duckdb.connect(config=settings) as database:
            schema = "SELECT DISTINCT name FROM parquet_schema(?)"
            there = {row[0] for row in database.execute(schema, [files]).fetchall()}
            # Records of an earlier version lack the columns that came later.
            asked = [
                name if name in there or name in NEEDED_COLUMNS else f"NULL AS {name}"
                for name in columns
            ]
            source = "read_parquet(?, union_by_name = true)"
            question = f"SELECT {', '.join(asked)} FROM {source} {where}"
            return database.execute(question, [files, *values]).fetchall()
    except duckdb.Error as error:
        reason = " ".join(str(error).split())
        where = ", ".join(map(str, studies))
        raise InputError(f"records of {where}: no study records, or damaged: {reason}") from error


def _record(columns: Sequence[str], row: Sequence[Any]) -> RunRecord:
    return RunRecord(
        **{name: _value(name, value) for name, value in zip(columns, row, strict=True)}
    )


def _value(name: str, value: Any) -> Any:
    if value is None:
        return _defaults[name]
    if isinstance(value, list):
        return tuple(math.nan if item is None else item for item in value)
    return value
