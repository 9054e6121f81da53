"""What a page's script knows of its figures: where each point is, and which run it opens."""

from collections.abc import Sequence
from typing import Any

from retraverse.reports.study_report.artefacts import Chapter, Figure, Line, Panel, slug
from retraverse.reports.study_report.run_files import run_address
from retraverse.reports.study_report.words import place_text, run_name
from retraverse.studies.keeping.records import RunRecord

__all__ = ["RunLinks", "chapter_points"]


class RunLinks:
    """Short names for runs on one page: place of the run's file in a list, and its K."""

    def __init__(self) -> None:
        self.files: list[tuple[str, int, int]] = []
        """Name of each file, and where in `names` and `places` stands what it is of."""
        self.names: list[str] = []
        """``"hog on Corridor"`` and so on."""
        self.places: list[str] = []
        """``"c = 50, 256 px"`` and so on."""
        self._places: dict[str, int] = {}

    def file(self, run: RunRecord) -> int:
        """Return the place of a run's file."""
        name = run_address(run)[0]
        if name not in self._places:
            self._places[name] = len(self.files)
            words = _place_in(self.names, run_name(run)), _place_in(self.places, place_text(run))
            self.files.append((name, *words))
        return self._places[name]

    def link(self, run: RunRecord) -> str:
        """Return a run's name on the page: ``"3/10"``."""
        return f"{self.file(run)}/{run.sequence_length}"


def _place_in(known: list[str], text: str) -> int:
    """Return where a text stands in a list, at its end if it was not in it."""
    if text not in known:
        known.append(text)
    return known.index(text)


def chapter_points(chapter: Chapter, keys: Sequence[str], links: RunLinks) -> dict[str, Any]:
    """Return the page's lines, and the points of all panels by "<artefact>-<panel number>"."""
    names: dict[tuple[str, str], int] = {}
    panels = {
        f"{key}-{at}": _panel_points(panel, links, names)
        for key, artefact in zip(keys, chapter.artefacts, strict=True)
        if isinstance(artefact, Figure)
        for at, panel in enumerate(artefact.panels)
    }
    return {"series": list(names), "panels": panels}


def _panel_points(
    panel: Panel, links: RunLinks, names: dict[tuple[str, str], int]
) -> dict[str, Any]:
    lines = [_line_points(line, links, names) for line in panel.lines]
    common = _commonest([line["px"] for line in lines])
    for line in lines:
        if _begins(common, line["px"]):
            del line["px"]
    return {
        "x": panel.x_label,
        "y": panel.y_label,
        "ticks": panel.x_ticks,
        "log": list(map(int, panel.is_log)),
        "px": common,
        "lines": lines,
    }


def _begins(whole: Sequence[float], part: Sequence[float]) -> bool:
    return list(whole[: len(part)]) == list(part)


def _commonest(found: Sequence[list[float]]) -> list[float]:
    """Return the places that most lines have, or begin with."""
    return max(found, key=lambda whole: sum(_begins(whole, part) for part in found), default=[])


def _line_points(line: Line, links: RunLinks, names: dict[tuple[str, str], int]) -> dict[str, Any]:
    name = line.series.label, slug(line.series.technique)
    files = [-1 if run is None else links.file(run) for run in line.runs]
    lengths = ["" if run is None else run.sequence_length for run in line.runs]
    x = [_short(value) for value in line.x]
    points: dict[str, Any] = {
        "s": names.setdefault(name, len(names)),
        # One file for all points, or one for each.
        "f": files[0] if len(set(files)) == 1 else files,
        "px": x,
        "py": [_short(y) for y in line.y],
    }
    if lengths != [f"{value:g}" for value in x]:
        points["k"] = lengths[0] if len(set(lengths)) == 1 else lengths
    return points


def _short(value: float) -> float:
    """Return a number of four figures, a whole one as such: it is shorter."""
    rounded = float(f"{value:.4g}")
    return int(rounded) if rounded.is_integer() else rounded
