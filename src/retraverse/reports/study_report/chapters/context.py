"""What every chapter is given, and what their tables have in common."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from retraverse.datasets.known import known_dataset
from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.picture_files import PictureFiles
from retraverse.reports.study_report.published import BY_CHAPTER, published_value
from retraverse.reports.study_report.series import Runs, Series, SeriesBook, headline_runs
from retraverse.reports.study_report.words import dataset_title
from retraverse.reports.wording import NOTHING, percent, plain, ratio, seconds
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "ChapterInput",
    "auc_cell",
    "long_table",
    "percent_cell",
    "published_key",
    "seconds_cell",
    "whole_cell",
]


@dataclass(frozen=True)
class ChapterInput:
    """The records of one page, and what was asked for."""

    key: str
    """``"3"`` to ``"7"``, ``"beyond"``, ``"runs"``."""
    records: tuple[RunRecord, ...]
    """Light records: without answers."""
    in_full: Callable[[Sequence[RunRecord]], Sequence[RunRecord]]
    """Reads records with their answers."""
    book: SeriesBook
    is_published: bool = True
    """Whether the thesis' values stand beside ours."""
    pictures: PictureFiles | None = None
    """Writes thumbnails, where pictures are at hand."""

    @property
    def over_length(self) -> Runs:
        """Return the runs in lines along K."""
        return Runs(self.records, self.book)

    def headlines(self, *, at: Sequence[str] = ()) -> Runs:
        """Return the runs in lines of one K each."""
        return Runs(headline_runs(self.records, at=at), self.book, over_length=False)

    @property
    def single_frames(self) -> Runs:
        """Return the runs with K = 1 in lines; where there are none, those of `headlines`."""
        singles = [run for run in self.records if run.sequence_length == "1"]
        if not singles:
            return self.headlines()
        return Runs(singles, self.book)

    @property
    def sequences(self) -> tuple[str, Runs] | None:
        """Return the longest fixed K that is asked of the techniques, and its runs in lines.

        None if there is but one length, or so many that K is an axis of its own.
        """
        lengths = {run.sequence_length for run in self.records if run.sequence_length.isdigit()}
        if not 1 < len(lengths) <= 3:
            return None
        longest = max(lengths, key=int)
        runs = [run for run in self.records if run.sequence_length == longest]
        return longest, Runs(runs, self.book)

    @property
    def absent(self) -> tuple[str, ...]:
        """Return the names of the thesis' datasets that are not here."""
        here = {record.dataset for record in self.records if record.status != "missing"}
        return tuple(name for name in BY_CHAPTER.get(self.key, ()) if name not in here)

    def published(self, number: str, run: RunRecord, column: str, *, row: str = "") -> str:
        """Return the thesis' value for a run, "" unless its very pictures were used."""
        if not (self.is_published and _is_as_in_thesis(run)):
            return ""
        row = row or published_key(run)
        return published_value(number, row, column) or published_value(
            number, row, column, run.dataset
        )

    def absent_rows(self, lead: int, *, dataset_column: int) -> tuple[Row, ...]:
        """Return one row for every dataset of the thesis' table that is not here."""
        return tuple(
            Row(
                tuple(
                    Cell(dataset_title(name) if column == dataset_column else "")
                    for column in range(lead)
                ),
                absent="dataset not here",
            )
            for name in self.absent
        )


def _is_as_in_thesis(run: RunRecord) -> bool:
    known = known_dataset(run.dataset)
    if known is None or known.thesis_sizes is None:
        return False
    sizes = (run.n_queries, run.n_references)
    return sizes == known.thesis_sizes or (run.dataset == "17_places" and sizes == (420, 420))


def published_key(run: RunRecord) -> str:
    """Return what the tables of the thesis call a run's technique."""
    if run.technique == "convsequential":
        return f"convsequential_{'dynamic' if run.sequence_length == 'dynamic' else 'static'}"
    if run.matcher.startswith("seqslam"):
        names = {"5": "seqslam_5", "6": "seqslam_5", "10": "seqslam_10"}
        return names.get(run.sequence_length, "")
    return run.technique


def long_table(
    given: ChapterInput,
    runs: Sequence[tuple[Series, RunRecord, tuple[Cell, ...]]],
    *,
    number: str,
    title: str,
    head: Sequence[str],
    caption: str = "",
    definitions: tuple[tuple[str, str], ...] = (),
) -> Table:
    """Return a table of one row for each technique and dataset; cells follow those two."""
    rows = tuple(
        Row(
            (
                Cell(series.label, run=run),
                Cell(dataset_title(run.dataset)),
                *cells,
            ),
            technique=series.technique,
        )
        for series, run, cells in runs
    )
    absent = given.absent_rows(2, dataset_column=1) if number else ()
    return Table(
        number,
        title,
        ("Technique", "Dataset", *head),
        rows + absent,
        caption,
        definitions,
        lead=2,
        is_published=bool(number),
    )


def percent_cell(value: float, run: RunRecord | None = None, published: str = "") -> Cell:
    """Return a share as per cent."""
    return Cell(percent(value), value, run, published)


def auc_cell(run: RunRecord, published: str = "") -> Cell:
    """Return the AUC."""
    return Cell(ratio(run.auc), run.auc, published=published)


def seconds_cell(value: float, run: RunRecord | None = None, published: str = "") -> Cell:
    """Return a time in the unit that reads best."""
    return Cell(seconds(value), value, run, published)


def whole_cell(value: float | None, run: RunRecord | None = None, published: str = "") -> Cell:
    """Return a count; None = there is none."""
    if value is None:
        return Cell(NOTHING, float("nan"), run, published)
    return Cell(plain(value), value, run, published)
