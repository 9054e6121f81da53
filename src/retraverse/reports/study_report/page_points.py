"""What a page's script knows of its figures: where each point is, and which run it opens."""

from collections.abc import Sequence
from typing import Any

from retraverse.reports.study_report.artefacts import Chapter, Figure, Line, Panel, slug
from retraverse.reports.study_report.run_files import run_address
from retraverse.studies.records import RunRecord

__all__ = ["RunLinks", "chapter_points"]


class RunLinks:
    """Short names for runs on one page: place of the run's file in a list, and its K."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self._places: dict[str, int] = {}

    def file(self, run: RunRecord) -> int:
        """Return the place of a run's file."""
        name = run_address(run)[0]
        if name not in self._places:
            self._places[name] = len(self.files)
            self.files.append(name)
        return self._places[name]

    def link(self, run: RunRecord) -> str:
        """Return a run's name on the page: ``"3/10"``."""
        return f"{self.file(run)}/{run.sequence_length}"


def chapter_points(chapter: Chapter, keys: Sequence[str], links: RunLinks) -> dict[str, Any]:
    """Return the points of all panels of a page, by "<artefact>-<panel number>"."""
    return {
        f"{key}-{at}": _panel_points(panel, links)
        for key, artefact in zip(keys, chapter.artefacts, strict=True)
        if isinstance(artefact, Figure)
        for at, panel in enumerate(artefact.panels)
    }


def _panel_points(panel: Panel, links: RunLinks) -> dict[str, Any]:
    return {
        "x": panel.x_label,
        "y": panel.y_label,
        "ticks": panel.x_ticks,
        "log": panel.is_log,
        "lines": [_line_points(line, links) for line in panel.lines],
    }


def _line_points(line: Line, links: RunLinks) -> dict[str, Any]:
    files = [-1 if run is None else links.file(run) for run in line.runs]
    lengths = ["" if run is None else run.sequence_length for run in line.runs]
    return {
        "n": line.series.label,
        "t": slug(line.series.technique),
        # One file for all points, or one for each.
        "f": files[0] if len(set(files)) == 1 else files,
        "k": lengths[0] if len(set(lengths)) == 1 else lengths,
        "px": [_short(x) for x in line.x],
        "py": [_short(y) for y in line.y],
    }


def _short(value: float) -> float:
    return float(f"{value:.4g}")
