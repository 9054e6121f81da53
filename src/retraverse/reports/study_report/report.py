"""The report of a study: an index, a page for each chapter, and a small file for every run."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from retraverse._version import __version__
from retraverse.errors import InputError
from retraverse.reports.matrix_figure import RAMP
from retraverse.reports.page import render_page
from retraverse.reports.study_report.artefacts import (
    Artefact,
    Chapter,
    Figure,
    Sheet,
    Table,
    slug,
)
from retraverse.reports.study_report.chapters import CHAPTERS, ChapterInput
from retraverse.reports.study_report.choices import choices_table
from retraverse.reports.study_report.exports import artefact_keys, table_csv, write_exports
from retraverse.reports.study_report.findings import findings, tells_interval
from retraverse.reports.study_report.overview import (
    datasets_table,
    headline,
    troubles,
)
from retraverse.reports.study_report.page_files import put
from retraverse.reports.study_report.page_points import RunLinks, chapter_points
from retraverse.reports.study_report.panels import mark_of
from retraverse.reports.study_report.picture_files import PictureFiles, Pictures
from retraverse.reports.study_report.published import BY_CHAPTER
from retraverse.reports.study_report.run_files import RunFiles
from retraverse.reports.study_report.series import SeriesBook
from retraverse.reports.study_report.words import (
    MEANINGS,
    dataset_title,
    number_columns,
)
from retraverse.studies.judging.expectations import check_expectations
from retraverse.studies.keeping.light_records import (
    read_light_records,
    study_folders,
    with_long_columns,
)
from retraverse.studies.keeping.records import RunRecord
from retraverse.types import Progress, no_progress

__all__ = ["write_study_report"]

_STYLES = ("comparison.css", "study.css")
_SCRIPTS = ("widgets.js", "study_tables.js", "study_figures.js", "study_runs.js", "study_follow.js")


def write_study_report(
    study_folder: str | os.PathLike[str],
    out_folder: str | os.PathLike[str],
    *,
    published: bool = True,
    pictures: Pictures | None = None,
    cache: str | os.PathLike[str] | None = None,
    progress: Progress = no_progress,
) -> Path:
    """Write the report of a study and return its first page.

    The folder opens from disk without network: ``index.html``, one page for each chapter the
    records belong to, and beside them what a click opens (``runs``), the tables and figures as
    files (``exports``) and small pictures (``pictures``). Every number is read off the records.

    Parameters
    ----------
    study_folder : path
        A study's folder, ``records/*.parquet`` and ``cache`` in it, or a folder of several.
    out_folder : path
        Folder to write into; made where it does not exist.
    published : bool
        Whether the thesis' values stand beside ours where its pictures were used.
    pictures : callable, optional
        Gives a dataset with `query()`, `reference()` and `truth()` by its name, None if its
        pictures are not at hand: the report then shows matches in pictures, at the compression
        used. By default it shows none.
    cache : path, optional
        Where the study keeps its matrices, by default ``cache`` in its folder.
    progress : Progress
        Sees the runs being written.

    Returns
    -------
    Path
        ``index.html``.

    Raises
    ------
    DataMissingError
        If there are no records in `study_folder`.
    InputError
        If a record file is damaged, or `out_folder` is a file.

    Notes
    -----
    A study that is still running may be written again and again; pages are replaced whole.
    """
    out = Path(out_folder)
    if out.exists() and not out.is_dir():
        raise InputError(f"report {out}: got a file, expected a folder to write into")
    studies = study_folders(Path(study_folder))
    records = read_light_records(studies)
    out.mkdir(parents=True, exist_ok=True)

    def in_full(runs: Sequence[RunRecord]) -> Sequence[RunRecord]:
        return with_long_columns(studies, runs)

    caches = [Path(cache)] if cache is not None else [study / "cache" for study in studies]
    thumbnails = PictureFiles(out, pictures)
    made = []
    by_page = _by_page(records)
    for key in progress(list(by_page), total=len(by_page), label="pages of the report"):
        given = ChapterInput(
            key, tuple(by_page[key]), in_full, SeriesBook({}), published, thumbnails
        )
        made.append(_finished(CHAPTERS[key](given), given))
    # The pages' own pictures come first: those of runs end where there are enough.
    RunFiles(out, caches, thumbnails, in_full).write(records, progress)
    links = [(page_name(chapter.key), page_title(chapter)) for chapter in made]
    name = _study_name(records, Path(study_folder))
    for chapter in made:
        _write_chapter(chapter, out, links, name)
    return _write_index(records, made, out, links, name)


def page_name(key: str) -> str:
    """Return the file of a page."""
    return f"{key}.html" if key in ("beyond", "runs") else f"chapter-{key}.html"


def page_title(chapter: Chapter) -> str:
    """Return a page's title with its chapter."""
    return f"{chapter.key}. {chapter.title}" if chapter.key.isdigit() else chapter.title


def _by_page(records: Sequence[RunRecord]) -> dict[str, list[RunRecord]]:
    pages: dict[str, list[RunRecord]] = {key: [] for key in CHAPTERS}
    for run in records:
        pages[_page_of(run)].append(run)
    return {key: runs for key, runs in pages.items() if any(run.status == "ok" for run in runs)}


def _page_of(run: RunRecord) -> str:
    """Return the page a run is on: the thesis' chapters are about pictures that are sent."""
    if run.chapter not in CHAPTERS:
        return "runs"
    return "beyond" if run.descriptor_coding else run.chapter


def _study_name(records: Sequence[RunRecord], study: Path) -> str:
    names = {run.study for run in records}
    return names.pop() if len(names) == 1 else study.resolve().name


def _finished(chapter: Chapter, given: ChapterInput) -> Chapter:
    """Return the chapter without what is empty, and with what was found and is missing."""
    sections = []
    for section in chapter.sections:
        kept = tuple(item for item in section.artefacts if not _is_empty(item))
        if kept:
            sections.append(replace(section, artefacts=kept))
    absent = tuple(map(dataset_title, given.absent))
    tested = tuple(test for test in check_expectations(given.records) if test.holds is not None)
    return replace(
        chapter,
        sections=tuple(sections),
        absent=absent,
        findings=findings(chapter.key, given.records),
        expectations=tested,
    )


def _is_empty(artefact: Artefact) -> bool:
    if isinstance(artefact, Figure):
        return not artefact.panels
    return not (artefact.cases if isinstance(artefact, Sheet) else artefact.rows)


@dataclass(frozen=True)
class _Shown:
    """One artefact as the template takes it."""

    key: str
    item: Artefact
    exports: Sequence[Any]
    kind: str
    """``"table"``, ``"figure"``, ``"sheet"``, ``"gallery"``."""


def _write_chapter(
    chapter: Chapter, out: Path, pages: Sequence[tuple[str, str]], study: str
) -> None:
    links = RunLinks()
    keys = artefact_keys(chapter)
    exports = write_exports(chapter, out)
    shown = {
        id(item): _Shown(key, item, exports[key], type(item).__name__.lower())
        for key, item in zip(keys, chapter.artefacts, strict=True)
    }
    techniques = sorted({run.technique for run in chapter.records if run.status == "ok"})
    # Cells name their files too, so the list of files is complete only after them.
    for item in chapter.artefacts:
        if isinstance(item, Table):
            for row in item.rows:
                for cell in row.cells:
                    if cell.run is not None:
                        links.link(cell.run)
        if isinstance(item, Sheet):
            for case in item.cases:
                links.link(case.run)
    points = chapter_points(chapter, keys, links)
    _render(
        out / page_name(chapter.key),
        "study_chapter.html.j2",
        {
            "chapter": chapter,
            "shown": shown,
            "absent": chapter.absent,
            "has_intervals": any(tells_interval(said) for _, said in chapter.findings),
            "techniques": [(slug(name), name) for name in techniques],
            "troubles": troubles(chapter.records),
            **_frame(links, points, pages, study, page_name(chapter.key)),
        },
    )


def _write_index(
    records: Sequence[RunRecord],
    chapters: Sequence[Chapter],
    out: Path,
    pages: Sequence[tuple[str, str]],
    study: str,
) -> Path:
    links = RunLinks()
    measured = [run for run in records if run.status == "ok"]
    here = {run.dataset for run in measured}
    wanted = [name for chapter in chapters for name in BY_CHAPTER.get(chapter.key, ())]
    absent = [name for name in dict.fromkeys(wanted) if name not in here]
    choices = choices_table(measured)
    put(out / "exports" / "choices.csv", table_csv(choices).encode())
    for row in choices.rows:
        for cell in row.cells:
            if cell.run is not None:
                links.link(cell.run)
    path = out / "index.html"
    _render(
        path,
        "study_index.html.j2",
        {
            "headline": headline(records),
            "records": records,
            "chapters": [(page_name(chapter.key), chapter) for chapter in chapters],
            "choices": choices,
            "datasets": datasets_table(records, absent),
            "expectations": check_expectations(records),
            "troubles": troubles(records),
            "techniques": [],
            **_frame(links, {"series": [], "panels": {}}, pages, study, "index.html"),
        },
    )
    return path


def _frame(
    links: RunLinks,
    points: Mapping[str, Any],
    pages: Sequence[tuple[str, str]],
    study: str,
    here: str,
) -> dict[str, Any]:
    """Return what every page of a study has."""
    names = [name for name, _ in number_columns(_NO_RUN, 0)]
    return {
        "links": links,
        "pages": pages,
        "here": here,
        "study": study,
        "version": __version__,
        "ramp": RAMP,
        "slug": slug,
        "mark_of": mark_of,
        "artefact_id": id,
        "data": {
            "files": links.files,
            "names": links.names,
            "places": links.places,
            **points,
            "numbers": [[name, MEANINGS.get(name, "")] for name in names],
        },
    }


_NO_RUN = RunRecord("", "", "", "")


def _render(path: Path, template: str, context: Mapping[str, Any]) -> None:
    page = render_page(template, context, styles=_STYLES, scripts=_SCRIPTS)
    put(path, page.encode())
