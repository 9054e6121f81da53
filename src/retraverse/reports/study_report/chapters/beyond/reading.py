"""What can still be read in pictures, and what is still recognised in them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from retraverse.reports.study_report.artefacts import Artefact, Cell, Figure, Row, Table
from retraverse.reports.study_report.chapters.beyond.chosen import read_settings
from retraverse.reports.study_report.figures import PERCENT, scattered
from retraverse.reports.study_report.series import Place, Runs, Series, SeriesBook
from retraverse.reports.study_report.words import (
    dataset_title,
    meanings,
    measured_on,
)
from retraverse.reports.wording import NOTHING, percent
from retraverse.studies.keeping.records import RunRecord

__all__ = ["CAUTION", "character_distance", "reading_artefacts"]

CHARACTER_M = 0.075
"""Height of a number plate's characters."""
FIELD_DEG = 60
"""Field of view of the camera that distances are told for."""
LARGEST = 0.25
"""Share of the side up to which characters were tried."""
CAUTION = (
    "A stand-in for privacy, measured in made-up scenes with a number plate's characters: it says "
    "nothing about faces, nor about somebody who puts many pictures of one plate together. "
    f"Distances are those at which characters of {1000 * CHARACTER_M:g} mm are just that large "
    f"for a camera with a field of {FIELD_DEG} degrees; what is nearer can be read."
)


def character_distance(height: float) -> float:
    """Return at how many metres a plate's characters take up a share of the picture's side."""
    return CHARACTER_M / (2 * math.tan(math.radians(FIELD_DEG / 2)) * height)


@dataclass(frozen=True)
class _Way:
    """Pictures of one dataset made worse in one way, and who saw them."""

    place: Place
    height: float
    """NaN if nothing could be read."""
    runs: Mapping[Series, RunRecord]


def reading_artefacts(records: Iterable[RunRecord]) -> tuple[Artefact, ...]:
    """Return accuracy over legible height as a figure, and a table for each dataset."""
    measured = read_settings(records)
    if not measured:
        return ()
    has_lengths = len({run.sequence_length for run in measured}) > 1
    runs = Runs(measured, SeriesBook({}), over_length=not has_lengths)
    return (_figure(runs), *(_table(runs, dataset) for dataset in runs.datasets))


def _figure(runs: Runs) -> Figure:
    def points(series: Series, dataset: str) -> Sequence[tuple[float, float, RunRecord]]:
        return [
            (100 * run.legible_height, 100 * run.accuracy, run)
            for place in runs.places_of(series, dataset)
            for run in runs.at(series, dataset, place)
        ]

    return scattered(
        runs,
        points,
        number="",
        title="Accuracy against what can be read",
        x_label="Smallest legible height, % of the side",
        y_label="Accuracy, %",
        caption="Each point is one size and c. Further to the right less can be read, higher up "
        "more is recognised. Settings in which nothing can be read, "
        f"up to {100 * LARGEST:g} % of the side, are in the tables.",
        definitions=meanings("legible height", "accuracy", "c"),
        is_log=(True, False),
        y_limits=PERCENT,
    )


def _table(runs: Runs, dataset: str) -> Table:
    series = [one for one in runs.series if runs.places_of(one, dataset)]
    ways = _ways(runs, series, dataset)
    best = {one: max((way.runs[one].accuracy for way in ways if one in way.runs), default=1.0)
            for one in series}  # fmt: skip
    sample = next(iter(ways[0].runs.values()))
    return Table(
        "",
        f"{dataset_title(dataset)}: what can be read, and what is recognised",
        ("Side", "c", "Legible height", "Distance", *(one.label for one in series)),
        tuple(_row(way, series, best) for way in ways),
        f"Accuracy on {measured_on(sample)}, query and map alike{_length(runs)}; bold: the best of "
        "its column. "
        f"“none”: not even characters of {100 * LARGEST:g} % of the side.",
        meanings("legible height", "accuracy", "c", "K"),
    )


def _length(runs: Runs) -> str:
    """Return the K that all runs have, "" if it is in the names of the columns."""
    lengths = {run.sequence_length for run in runs.records}
    return f", K = {lengths.pop()}" if len(lengths) == 1 else ""


def _ways(runs: Runs, series: Sequence[Series], dataset: str) -> list[_Way]:
    """Return the ways of a dataset, large pictures first, compressed ever more."""
    found: dict[Place, dict[Series, RunRecord]] = {}
    for one in series:
        for place in runs.places_of(one, dataset):
            for run in runs.at(one, dataset, place):
                found.setdefault(place, {})[one] = run
    ordered = sorted(
        found, key=lambda place: (-(place.resize or math.inf), place.compression_query, place)
    )
    return [
        _Way(place, next(iter(found[place].values())).legible_height, found[place])
        for place in ordered
    ]


def _row(way: _Way, series: Sequence[Series], best: Mapping[Series, float]) -> Row:
    side, height = way.place.resize, way.height
    is_none = math.isnan(height)
    distance = math.nan if is_none else character_distance(height)
    return Row(
        (
            Cell(f"{side} px" if side else "as is", float(side or math.inf)),
            Cell(way.place.query_text, float(way.place.compression_query)),
            Cell("none", math.inf) if is_none else Cell(percent(height), height),
            Cell(NOTHING, 0.0) if is_none else Cell(f"{distance:.1f} m", distance),
            *(_accuracy(way.runs.get(one), best[one]) for one in series),
        )
    )


def _accuracy(run: RunRecord | None, best: float) -> Cell:
    if run is None:
        return Cell(NOTHING, math.nan)
    return Cell(percent(run.accuracy), run.accuracy, run, is_best=run.accuracy >= best)
