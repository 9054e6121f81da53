"""The thesis' printed numbers, to stand beside ours where the same pictures were used."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

__all__ = ["BY_CHAPTER", "PublishedTable", "published_table", "published_value"]

BY_CHAPTER: Mapping[str, tuple[str, ...]] = {
    "3": ("campus_loop", "gardens_point_day", "gardens_point_night", "nordland"),
    "4": ("campus_loop", "gardens_point_day", "gardens_point_night", "nordland"),
    "5": (
        "17_places",
        "nordland",
        "campus_loop",
        "gardens_point_day",
        "gardens_point_night",
        "oxford_robotcar",
        "essex3in1",
        "synthia",
    ),
    "6": ("essex3in1", "campus_loop", "gardens_point_night", "17_places"),
    "7": ("17_places", "campus_loop", "gardens_point_night", "nordland", "synthia"),
}
"""The datasets each chapter of the thesis uses."""


@dataclass(frozen=True)
class PublishedTable:
    """One table, or one dataset's part of it."""

    number: str
    dataset: str
    """"" where the datasets are rows or columns."""
    quantity: str
    unit: str
    columns: tuple[str, ...]
    rows: Mapping[str, tuple[float | str, ...]]

    def value(self, row: str, column: str) -> str:
        """Return a cell as printed, "" where the thesis has none."""
        values = self.rows.get(row)
        if values is None or column not in self.columns:
            return ""
        value = values[self.columns.index(column)]
        return "" if value == "-" else f"{value:g}" if isinstance(value, float | int) else value


def published_table(number: str, dataset: str = "") -> PublishedTable | None:
    """Return a table of the thesis by its number, or None if it is not kept here."""
    return next(
        (table for table in _tables() if (table.number, table.dataset) == (number, dataset)), None
    )


def published_value(number: str, row: str, column: str, dataset: str = "") -> str:
    """Return one cell of a table of the thesis as printed, "" where there is none."""
    table = published_table(number, dataset)
    return "" if table is None else table.value(row, column)


@cache
def _tables() -> tuple[PublishedTable, ...]:
    place = resources.files("retraverse.reports.study_report") / "published.toml"
    return tuple(
        PublishedTable(
            number=table["number"],
            dataset=table.get("dataset", ""),
            quantity=table["quantity"],
            unit=table["unit"],
            columns=tuple(table["columns"]),
            rows={name: tuple(values) for name, values in table["rows"].items()},
        )
        for table in tomllib.loads(place.read_text("utf-8"))["table"]
    )
