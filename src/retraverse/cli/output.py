"""What the user sees: results on stdout, progress and remarks on stderr."""

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from retraverse.types import Progress, no_progress

__all__ = ["print_json", "print_table", "progress", "remark"]

Item = TypeVar("Item")


def print_json(result: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print a result as JSON; numbers that JSON cannot hold (NaN) become null."""
    print(json.dumps(_plain(result), indent=2, allow_nan=False, ensure_ascii=False))


def print_table(rows: Sequence[Sequence[str]], *, head: Sequence[str]) -> None:
    """Print rows under their headings, columns aligned."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in head:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(soft_wrap=not sys.stdout.isatty()).print(table)


def remark(text: str) -> None:
    """Say something beside the result, on stderr."""
    print(text, file=sys.stderr)


def progress() -> Progress:
    """Return bars on stderr, or nothing where stderr is not a terminal."""
    return _bar if sys.stderr.isatty() else no_progress


def _bar(items: Iterable[Item], *, total: int, label: str) -> Iterable[Item]:
    from rich.console import Console
    from rich.progress import track

    return track(
        items, description=label, total=total, console=Console(stderr=True), transient=True
    )


def _plain(value: Any) -> Any:
    """Return `value` with tuples as lists, NumPy numbers as Python's, and NaN as None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
