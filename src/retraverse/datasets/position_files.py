"""Positions of frames as a CSV file: along the route, or east and north, in metres."""

import csv
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import DataMissingError, InputError

__all__ = ["load_positions"]

COLUMN_SETS = (("position_m",), ("east_m", "north_m"), ("x_m", "y_m"))


def load_positions(path: str | PathLike[str]) -> NDArray[np.float64]:
    """Read the position of every frame, one row per frame in order.

    Parameters
    ----------
    path : path
        A CSV file with a head line that names ``position_m`` (along the route), or ``east_m``
        and ``north_m``, or ``x_m`` and ``y_m``; other columns are ignored.

    Returns
    -------
    positions : float64 array, shape (N, 1) or (N, 2)
        Metres; NaN where a cell is empty: the frame lies off the map.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If the columns are not there or a cell is no number; the message names the line.
    """
    path = Path(path)
    if not path.is_file():
        raise DataMissingError(f"positions {path}: no such file; expected a CSV of metres")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"positions {path}: not a CSV text ({error})") from error
    columns = _columns(path, set(rows[0]) if rows else set())
    cells = [
        [_metres(path, line, row[column]) for column in columns]
        for line, row in enumerate(rows, start=2)
    ]
    return np.array(cells, np.float64)


def _columns(path: Path, found: set[str]) -> tuple[str, ...]:
    for columns in COLUMN_SETS:
        if found >= set(columns):
            return columns
    named = "; or ".join(" and ".join(columns) for columns in COLUMN_SETS)
    raise InputError(
        f"positions {path}: got columns {', '.join(sorted(map(str, found))) or 'none'}; "
        f"expected {named}"
    )


def _metres(path: Path, line: int, cell: str | None) -> float:
    if not cell:
        return float("nan")
    try:
        metres = float(cell)
    except ValueError:
        metres = float("inf")
    if not np.isfinite(metres):
        raise InputError(f"positions {path}, line {line}: got {cell!r}, expected metres")
    return metres
