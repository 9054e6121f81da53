"""Matches as a CSV file: one row for every query frame, so that nothing is hidden.

Columns: ``query, query_name, reference, reference_name, score, sequence_length, n_references,
frame_reference``. A query frame that names no window has empty cells after its name; "no match" is
reference -1. ``n_references`` repeats the size of the map, which every judgement of the matches
needs; ``frame_reference`` is where each single frame belongs (`Matches.frame_reference`) and may be
missing.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from retraverse.errors import DataMissingError, InputError
from retraverse.files import write_whole
from retraverse.matching.matches import NO_MATCH, Matches

__all__ = ["load_matches", "save_matches"]

COLUMNS = (
    "query",
    "query_name",
    "reference",
    "reference_name",
    "score",
    "sequence_length",
    "n_references",
    "frame_reference",
)


def save_matches(
    matches: Matches,
    path: Path | str,
    *,
    query_names: Sequence[str],
    reference_names: Sequence[str],
) -> None:
    """Write matches as CSV; the file is whole or not there."""
    answered = {int(query): window for window, query in enumerate(matches.query)}
    frame_reference = matches.frame_reference.tolist()
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for query, name in enumerate(query_names):
        cells = [""] * 4
        if query in answered:
            cells = _answer_cells(matches, answered[query], reference_names)
        writer.writerow([query, name, *cells, matches.n_references, frame_reference[query]])
    write_whole(Path(path), text.getvalue().encode())


def load_matches(path: Path | str) -> Matches:
    """Read matches from CSV; only the numbers are needed, names may be anything.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If a column is missing or a cell is no number; the message names the line.
    """
    path = Path(path)
    if not path.is_file():
        raise DataMissingError(f"matches {path}: no such file; expected a CSV made by `localize`")
    rows = _read_rows(path)
    if not rows:
        raise InputError(f"matches {path}: no rows, expected one per query frame")
    n_references = {int(_number(row, "n_references", path, int)) for row in rows}
    if len(n_references) > 1:
        raise InputError(f"matches {path}: n_references differs between rows; joined files?")
    answered = [row for row in rows if row["reference"] != ""]
    matches = Matches(
        query=np.array([_number(row, "query", path, int) for row in answered], np.int64),
        reference=np.array([_number(row, "reference", path, int) for row in answered], np.int64),
        score=np.array([_number(row, "score", path, float) for row in answered], np.float32),
        sequence_length=np.array(
            [_number(row, "sequence_length", path, int) for row in answered], np.int64
        ),
        n_queries=len(rows),
        n_references=n_references.pop(),
    )
    if "frame_reference" not in rows[0]:
        return matches
    followed = np.array([_number(row, "frame_reference", path, int) for row in rows], np.int64)
    follows_diagonals = np.array_equal(followed, matches.frame_reference)
    return matches if follows_diagonals else replace(matches, followed=followed)


def _answer_cells(matches: Matches, window: int, reference_names: Sequence[str]) -> list[str]:
    reference = int(matches.reference[window])
    name = "" if reference == NO_MATCH else reference_names[reference]
    score = np.format_float_positional(matches.score[window], unique=True)
    return [str(reference), name, score, str(int(matches.sequence_length[window]))]


def _read_rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"matches {path}: not a CSV text ({error})") from error
    needed = {"query", "reference", "score", "sequence_length", "n_references"}
    missing = needed - set(rows[0] if rows else needed)
    if missing:
        raise InputError(
            f"matches {path}: column {', '.join(sorted(missing))} is missing; "
            f"expected {', '.join(COLUMNS)}"
        )
    for line, row in enumerate(rows, start=2):
        row["line"] = str(line)
    return rows


def _number(row: dict[str, str], column: str, path: Path, kind: type) -> float:
    try:
        return float(kind(row[column]))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"matches {path}, line {row['line']}: {column} is {row[column]!r}, expected a number"
        ) from error
