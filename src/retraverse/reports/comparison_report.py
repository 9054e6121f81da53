"""The report of one comparison: a single HTML page that needs nothing beside it.

The page opens from disk: style, script, figures and pictures are inside, and its content
policy forbids it to ask the network for anything. It draws from the record only.
"""

import os
from pathlib import Path

from retraverse.errors import InputError, ShapeError
from retraverse.files import write_whole
from retraverse.reports.curve_figures import (
    accuracy_by_length,
    length_histogram,
    precision_recall,
    route_figure,
)
from retraverse.reports.matrix_figure import RAMP, matrix_figure
from retraverse.reports.numbers import cost_numbers, key_figures, quality_numbers
from retraverse.reports.page import render_page
from retraverse.reports.page_data import (
    facts_text,
    is_wide,
    script_data,
    sheets_of,
    verdict_text,
    walk_of,
)
from retraverse.reports.pictures import PictureBook, Pictures
from retraverse.reports.windows import windows_of
from retraverse.studies.comparison_record import ComparisonRecord, TraverseRecord
from retraverse.types import Progress, no_progress

__all__ = ["comparison_html", "write_comparison_report"]


def write_comparison_report(
    record: ComparisonRecord,
    path: str | os.PathLike[str],
    *,
    reference: Pictures,
    query: Pictures,
    progress: Progress = no_progress,
) -> Path:
    """Write the report of `record` and return where it is.

    The page appears whole or not at all: it is written beside `path` and then renamed. Folders
    on the way are made.

    Parameters
    ----------
    record
        The comparison.
    path
        The HTML file to write; an existing one is replaced.
    reference, query
        The frames of the two traverses, by number: `Traverse` or any sequence of objects with
        `.colour()`. Only the shown ones are read; one that cannot be read any more becomes a
        grey field that says so.
    progress
        Sees the pictures being read.

    Raises
    ------
    ShapeError
        If a traverse has another number of frames than the record.
    InputError
        If `path` is a folder.
    """
    target = Path(path)
    if target.is_dir():
        raise InputError(f"report {str(target)!r}: got a folder, expected the name of an HTML file")
    html = comparison_html(record, reference=reference, query=query, progress=progress)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, html.encode())
    return target


def comparison_html(
    record: ComparisonRecord,
    *,
    reference: Pictures,
    query: Pictures,
    progress: Progress = no_progress,
) -> str:
    """Return the page of `write_comparison_report` as text."""
    for name, frames, traverse in (
        ("reference", reference, record.reference),
        ("query", query, record.query),
    ):
        _check_length(name, frames, traverse)
    windows = windows_of(record)
    book = PictureBook(query, reference)
    sheets = sheets_of(record, windows, book, progress)
    walk = walk_of(windows, book, progress)
    context = {
        "record": record,
        "windows": windows,
        "sheets": sheets,
        "walk": walk,
        "first_step": walk[len(walk) // 2] if walk else None,
        "wide_pictures": is_wide(book),
        "matrix": matrix_figure(record, windows),
        "ramp": RAMP,
        "pr": precision_recall(record),
        "histogram": length_histogram(record),
        "by_length": accuracy_by_length(record),
        "route_wide": route_figure(record, windows, wide=True),
        "route_narrow": route_figure(record, windows, wide=False),
        "quality": quality_numbers(record),
        "costs": cost_numbers(record),
        "key_figures": key_figures(record),
        "unreadable": [key for key, picture in book.pictures.items() if not picture.readable],
        "data": script_data(record, windows, walk, sheets, book),
        "verdict_text": verdict_text,
        "facts_text": facts_text,
    }
    return render_page(
        "comparison.html.j2",
        context,
        styles=("comparison.css",),
        scripts=("widgets.js", "comparison.js"),
    )


def _check_length(name: str, frames: Pictures, traverse: TraverseRecord) -> None:
    if len(frames) != traverse.n_frames:
        raise ShapeError(
            f"pictures of the {name} traverse: got {len(frames)} frames, expected the record's "
            f"{traverse.n_frames}; is it the traverse that was compared?"
        )
