"""What a chapter's page is made of: tables and figures whose every value leads to a run.

Nothing here draws or writes; `drawing`, `exports` and the templates do.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from retraverse.reports.study_report.series import Series
from retraverse.reports.svg import Plot
from retraverse.studies.judging.expectations import Expectation
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "Artefact",
    "Case",
    "Cell",
    "Chapter",
    "Figure",
    "Gallery",
    "GalleryPicture",
    "GalleryRow",
    "Line",
    "Panel",
    "Row",
    "Section",
    "Sheet",
    "Table",
    "slug",
]


@dataclass(frozen=True)
class Cell:
    """One value of a table."""

    text: str
    value: float | None = None
    """What the column sorts by; None = by the text. NaN sorts last."""
    run: RunRecord | None = None
    """The run it was read from."""
    published: str = ""
    """The thesis' value, in the same unit."""
    note: str = ""
    """What stands beside the value in small type."""
    is_best: bool = False
    """Whether it is the best of its column."""

    @property
    def sorts_by(self) -> str | None:
        """Return what the page sorts by; "" for a number that does not exist.

        None where the text says just that: most cells need no second saying.
        """
        if self.value is None:
            key = self.text
        else:
            key = "" if math.isnan(self.value) else f"{self.value:.6g}"
        stands_alone = not (self.note or self.published)
        return None if stands_alone and key == self.text else key


@dataclass(frozen=True)
class Row:
    """One row; the first cell is its heading."""

    cells: tuple[Cell, ...]
    technique: str = ""
    """Technique it belongs to, for the filter; "" = always shown."""
    absent: str = ""
    """Why there is nothing in it, such as "dataset not here"."""


@dataclass(frozen=True)
class Table:
    """One table."""

    number: str
    """``"Table 4.1"``, or "" for one of our own."""
    title: str
    head: tuple[str, ...]
    rows: tuple[Row, ...]
    caption: str = ""
    """How to read it, a sentence or two."""
    definitions: tuple[tuple[str, str], ...] = ()
    """(name, definition) of every number in it."""
    lead: int = 1
    """Columns at the left that name the row; the others are numbers."""
    is_published: bool = field(default=False)
    """Whether the thesis prints this table, so that its datasets may be missed."""


@dataclass(frozen=True)
class Line:
    """One series in one panel."""

    series: Series
    x: tuple[float, ...]
    y: tuple[float, ...]
    runs: tuple[RunRecord | None, ...]
    """None where a point is a mean over several runs."""
    low: tuple[float, ...] = ()
    """Lower ends of intervals, where they are drawn."""
    high: tuple[float, ...] = ()


@dataclass(frozen=True)
class Panel:
    """One drawing, as a rule one dataset."""

    title: str
    note: str
    """Number of queries and tolerance."""
    plot: Plot
    lines: tuple[Line, ...]
    x_label: str
    y_label: str
    x_ticks: tuple[str, ...] = ()
    """Names of the places 0, 1, 2 ... of an axis of steps; empty for an axis of numbers."""
    is_log: tuple[bool, bool] = (False, False)
    """Whether x and y are drawn in powers of ten."""
    technique: str = ""
    """Technique that all of it belongs to, for the filter; "" = several."""


@dataclass(frozen=True)
class Figure:
    """One figure of one or more panels."""

    number: str
    title: str
    panels: tuple[Panel, ...]
    caption: str = ""
    definitions: tuple[tuple[str, str], ...] = ()

    @property
    def needs_legend(self) -> bool:
        """Say whether its lines are named nowhere else; rows of dots have their names beside."""
        return bool(self.panels[0].y_label)

    @property
    def legend(self) -> tuple[Series, ...]:
        """Return every series in it, in the order of the page."""
        found = {line.series for panel in self.panels for line in panel.lines}
        return tuple(sorted(found, key=lambda series: series.index))


@dataclass(frozen=True)
class Case:
    """One window in pictures: some of its frames over the map frames they were matched with."""

    is_correct: bool
    text: str
    """Where it is, and how sure."""
    run: RunRecord
    pairs: tuple[tuple[tuple[str, str], tuple[str, str]], ...]
    """(query, map) of each frame shown: address and description of the picture."""


@dataclass(frozen=True)
class Sheet:
    """Right and wrong matches in pictures."""

    number: str
    title: str
    cases: tuple[Case, ...]
    caption: str = ""
    definitions: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class GalleryPicture:
    """One picture of a gallery."""

    address: str
    """Where it lies, "" if it cannot be had."""
    alt: str
    """What it shows, for those who do not see it."""
    note: str
    """What stands under it."""


@dataclass(frozen=True)
class GalleryRow:
    """Pictures of one frame."""

    title: str
    pictures: tuple[GalleryPicture, ...]


@dataclass(frozen=True)
class Gallery:
    """Pictures drawn over in several ways, a row for each frame."""

    number: str
    title: str
    rows: tuple[GalleryRow, ...]
    caption: str = ""
    definitions: tuple[tuple[str, str], ...] = ()


Artefact = Table | Figure | Sheet | Gallery


@dataclass(frozen=True)
class Section:
    """A question, and the artefacts that answer it."""

    title: str
    artefacts: tuple[Artefact, ...]
    lead: str = ""
    """One sentence on what to look for."""


@dataclass(frozen=True)
class Chapter:
    """One page."""

    key: str
    """``"3"`` to ``"7"``, ``"beyond"`` or ``"runs"``."""
    title: str
    question: str
    """What an engineer reads it for."""
    sections: tuple[Section, ...]
    records: tuple[RunRecord, ...] = field(repr=False)
    absent: tuple[str, ...] = ()
    """Datasets of the thesis' chapter that are not here, as people write them."""
    findings: tuple[tuple[str, str], ...] = ()
    """(dataset, what was found there in a sentence or two)."""
    expectations: tuple[Expectation, ...] = ()
    """What was expected and could be tested on these records."""

    @property
    def artefacts(self) -> Sequence[Artefact]:
        """Return all tables and figures."""
        return [artefact for section in self.sections for artefact in section.artefacts]


@lru_cache(maxsize=4096)
def slug(text: str) -> str:
    """Return text as a name for files, classes and anchors: "Table 4.1" -> "table-4-1"."""
    kept = "".join(letter if letter.isalnum() else "-" for letter in text.lower())
    return "-".join(part for part in kept.encode("ascii", "ignore").decode().split("-") if part)
