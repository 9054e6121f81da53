"""Tables and figures as files beside the pages: CSV, LaTeX, SVG."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from retraverse.reports.study_report.artefacts import Artefact, Cell, Chapter, Figure, Table, slug
from retraverse.reports.study_report.page_files import put
from retraverse.reports.svg import standalone

__all__ = [
    "Export",
    "artefact_key",
    "artefact_keys",
    "figure_csv",
    "table_csv",
    "table_latex",
    "write_exports",
]

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "\u202f": r"\,",
    "–": "--",
    "−": "$-$",
    "×": r"$\times$",
    "µ": r"\textmu{}",
    "±": r"$\pm$",
}


@dataclass(frozen=True)
class Export:
    """One file beside the pages."""

    name: str
    """What the link says: ``"CSV"``, ``"LaTeX"``, ``"SVG"``."""
    path: str
    """Address relative to the pages."""


def artefact_key(artefact: Artefact) -> str:
    """Return a name for files and anchors."""
    return slug(f"{artefact.number} {artefact.title}" if artefact.number else artefact.title)


def artefact_keys(chapter: Chapter) -> list[str]:
    """Return one name for every artefact of a page, none twice."""
    keys: list[str] = []
    for artefact in chapter.artefacts:
        key, at = artefact_key(artefact)[:70], 1
        while (named := key if at == 1 else f"{key}-{at}") in keys:
            at += 1
        keys.append(named)
    return keys


def write_exports(chapter: Chapter, out: Path) -> dict[str, tuple[Export, ...]]:
    """Write the files of a page; return them by the artefacts' keys."""
    folder = out / "exports" / chapter.key
    exports = {}
    for key, artefact in zip(artefact_keys(chapter), chapter.artefacts, strict=True):
        files = _files(artefact)
        links = []
        for name, ending, text in files:
            file = f"{key}{ending}"
            put(folder / file, text.encode())
            links.append(Export(name, f"exports/{chapter.key}/{file}"))
        exports[key] = tuple(links)
    return exports


def _files(artefact: Artefact) -> list[tuple[str, str, str]]:
    """Return (name, ending, text) of an artefact's files; pictures are files already."""
    if isinstance(artefact, Table):
        return _table_files(artefact)
    return _figure_files(artefact) if isinstance(artefact, Figure) else []


def _table_files(table: Table) -> list[tuple[str, str, str]]:
    return [("CSV", ".csv", table_csv(table)), ("LaTeX", ".tex", table_latex(table))]


def _figure_files(figure: Figure) -> list[tuple[str, str, str]]:
    several = len(figure.panels) > 1
    drawings = [
        (
            f"SVG {panel.title}" if several else "SVG",
            f"-{slug(panel.title)}.svg" if several else ".svg",
            standalone(panel.plot),
        )
        for panel in figure.panels
    ]
    return [("CSV", ".csv", figure_csv(figure)), *drawings]


def table_csv(table: Table) -> str:
    """Return a table as CSV: numbers in their base unit (bytes, seconds, shares), then the text.

    The thesis' values follow in columns of their own, as printed.
    """
    published = [
        at
        for at in range(len(table.head))
        if any(at < len(row.cells) and row.cells[at].published for row in table.rows)
    ]
    rows = [[*table.head, *(f"{table.head[at]} (thesis)" for at in published)]]
    for row in table.rows:
        values = [_raw(cell.text, cell.value) for cell in row.cells]
        values += [row.absent] * (len(table.head) - len(values))
        thesis = [row.cells[at].published if at < len(row.cells) else "" for at in published]
        rows.append([*values, *thesis])
    return _csv(rows)


def figure_csv(figure: Figure) -> str:
    """Return every point of a figure: panel, line, x, y, interval, run."""
    rows = [["panel", "line", "x", "y", "low", "high", "run"]]
    for panel in figure.panels:
        for line in panel.lines:
            for at, run in enumerate(line.runs):
                x = panel.x_ticks[int(line.x[at])] if panel.x_ticks else f"{line.x[at]:.10g}"
                interval = (line.low[at], line.high[at]) if line.low else None
                rows.append(
                    [
                        panel.title,
                        line.series.label,
                        x,
                        f"{line.y[at]:.10g}",
                        *([f"{end:.10g}" for end in interval] if interval else ["", ""]),
                        run.run_id if run is not None else "",
                    ]
                )
    return _csv(rows)


def _raw(text: str, value: float | None) -> str:
    if value is None:
        return text
    return f"{value:.10g}" if abs(value) < float("inf") else text


def _csv(rows: Sequence[Sequence[str]]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(
        [[_harmless(value) for value in row] for row in rows]
    )
    return buffer.getvalue()


def _harmless(value: str) -> str:
    """Keep a spreadsheet from taking a name for a formula."""
    is_number = value.lstrip("-+").replace(".", "", 1).replace("e-", "").isalnum()
    return f"'{value}" if value[:1] in ("=", "+", "-", "@") and not is_number else value


def table_latex(table: Table) -> str:
    """Return a table as LaTeX, for the package booktabs."""
    columns = "l" * table.lead + "r" * (len(table.head) - table.lead)
    lines = [
        f"% {_escaped(table.number or table.title)}; needs \\usepackage{{booktabs}}",
        f"\\begin{{tabular}}{{{columns}}}",
        "\\toprule",
        " & ".join(_escaped(name) for name in table.head) + r" \\",
        "\\midrule",
    ]
    for row in table.rows:
        texts = [_latex_cell(cell) for cell in row.cells]
        if row.absent:
            span = len(table.head) - len(texts)
            texts.append(f"\\multicolumn{{{span}}}{{l}}{{{_escaped(row.absent)}}}")
        lines.append(" & ".join(texts) + r" \\")
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", ""])


def _latex_cell(cell: Cell) -> str:
    text = _escaped(cell.text)
    shown = f"\\textbf{{{text}}}" if cell.is_best else text
    return shown + (f" ({_escaped(cell.published)})" if cell.published else "")


def _escaped(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in text)
