"""Quantisation tables in a file: JSON with the steps of both planes at quality 50.

::

    {"name": "cohog-c95", "luminance": [16, 11, ...], "chrominance": [17, 18, ...]}

64 whole numbers each, in rows. The name, which records call the tables by, may be left out: then
it is the file's.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.files import write_whole
from retraverse.images import QuantisationTables
from retraverse.registry import unknown_name

__all__ = ["load_tables", "read_tables", "save_tables"]

_KEYS = ["name", "luminance", "chrominance"]


def save_tables(path: str | Path, tables: QuantisationTables) -> None:
    """Write tables as a JSON file, whole or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = json.dumps({key: getattr(tables, key) for key in _KEYS})
    try:
        write_whole(Path(path), text.encode() + b"\n")
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"quantisation tables {path}: cannot be written: {reason}") from error


def load_tables(path: str | Path) -> QuantisationTables:
    """Read the tables of a JSON file.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If it cannot be read or is not JSON.
    ConfigError
        If it does not hold two tables of 64 steps.
    """
    place = Path(path)
    try:
        values = json.loads(place.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DataMissingError(f"quantisation tables {place}: no such file") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"quantisation tables {place}: cannot be read: {reason}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"quantisation tables {place}: not JSON: {error}") from error
    return read_tables(values, f"quantisation tables {place}", default_name=place.stem)


def read_tables(
    values: object, where: str = "quantisation tables", *, default_name: str = "custom"
) -> QuantisationTables:
    """Return the tables that plain values describe.

    Parameters
    ----------
    values : mapping with lists "luminance" and "chrominance", perhaps text "name"
    where : str
        What messages call them.
    default_name : str
        Of tables without a name.

    Raises
    ------
    ConfigError
        If they are something else.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where}: got {_kind(values)}, expected luminance and chrominance")
    for key in values:
        if key not in _KEYS:
            raise ConfigError(unknown_name(f"key in {where}", key, _KEYS))
    name = values.get("name", default_name)
    if not isinstance(name, str) or not name.isprintable() or not name.strip():
        raise ConfigError(f"{where}: name: got {name!r}, expected a text")
    luminance, chrominance = (_steps(values.get(plane), plane, where) for plane in _KEYS[1:])
    try:
        return QuantisationTables(luminance, chrominance, name)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def _steps(value: Any, plane: str, where: str) -> tuple[int, ...]:
    if not isinstance(value, list):
        raise ConfigError(f"{where}: {plane}: got {_kind(value)}, expected a list of 64 steps")
    for step in value:
        if not isinstance(step, int) or isinstance(step, bool):
            raise ConfigError(f"{where}: {plane}: got {step!r}, expected whole steps")
    return tuple(value)


def _kind(value: object) -> str:
    return "nothing" if value is None else type(value).__name__
