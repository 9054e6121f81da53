"""Read the true matches of a set from a file."""

import json
from os import PathLike
from pathlib import Path
from typing import Any

from retraverse.errors import DataMissingError, InputError

__all__ = ["read_positives"]

EXPECTED = 'expected {"query index": [reference indices], ...}'


def read_positives(path: str | PathLike[str]) -> list[list[int]]:
    """Read ``{"query index": [reference indices], ...}`` and return the lists in query order.

    Raises
    ------
    DataMissingError
        If `path` is no file.
    InputError
        If it is no such JSON, or a query is repeated or missing; the message names it.
    """
    path = Path(path)
    if not path.is_file():
        kind = "is a folder" if path.is_dir() else "does not exist"
        raise DataMissingError(f"ground truth {path}: it {kind}; expected a JSON file")
    try:
        members = json.loads(path.read_text("utf-8-sig"), object_pairs_hook=_unique(path))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"ground truth {path}: not JSON ({error}); {EXPECTED}") from error
    if not isinstance(members, dict) or not members:
        raise InputError(f"ground truth {path}: got {_kind(members)}; {EXPECTED}")
    by_query = {_query(path, key): _references(path, key, members[key]) for key in members}
    missing = sorted(set(range(max(by_query) + 1)) - by_query.keys())
    if missing:
        raise InputError(
            f"ground truth {path}: {len(missing)} queries are missing, the first is {missing[0]}; "
            f"expected all from 0 to {max(by_query)}, with [-1] for those without a match"
        )
    return [by_query[query] for query in range(len(by_query))]


def _unique(path: Path) -> Any:
    """Return a hook that refuses the repeated keys JSON would silently overwrite."""

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        seen: dict[str, Any] = {}
        for key, value in pairs:
            if key in seen:
                raise InputError(f"ground truth {path}: query {key!r} is there twice")
            seen[key] = value
        return seen

    return members


def _query(path: Path, key: str) -> int:
    """Return the query that `key` names; "01" is refused, as it would name query 1 again."""
    if not (key.isascii() and key.isdigit() and str(int(key)) == key):
        raise InputError(f"ground truth {path}: got query {key!r}, expected an index from 0")
    return int(key)


def _references(path: Path, key: str, value: Any) -> list[int]:
    is_list = isinstance(value, list) and all(type(item) is int for item in value)
    if not is_list or any(item < -1 for item in value) or (-1 in value and set(value) != {-1}):
        raise InputError(
            f"ground truth {path}: query {key} has {str(value)[:60]}, "
            "expected a list of reference indices from 0, or [-1] for no match"
        )
    return list(value)


def _kind(members: Any) -> str:
    return "no queries" if members == {} else type(members).__name__
