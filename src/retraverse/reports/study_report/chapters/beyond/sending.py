"""Descriptors instead of pictures: what they weigh when they are not sent number by number."""

from collections.abc import Iterable

from retraverse.reports.study_report.artefacts import Artefact
from retraverse.reports.study_report.chapters.beyond.video import way_of_pictures
from retraverse.reports.study_report.chapters.beyond.ways import (
    Way,
    WayCase,
    way_cases,
    ways_figures,
    ways_table,
)
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.studies.keeping.records import RunRecord
from retraverse.techniques.sending import CODINGS

__all__ = ["EXACT", "sending_artefacts", "sending_cases"]

EXACT = "exact"
"""The coding that changes nothing: what the others are measured against."""


def sending_cases(records: Iterable[RunRecord]) -> list[WayCase]:
    """Return what there is to compare: settings whose descriptors were sent in several codings.

    Pictures that were sent in place of them count if they were matched with the same map.
    """
    return way_cases(records, EXACT, _way_of, lambda run: bool(run.descriptor_coding))


def _way_of(run: RunRecord) -> Way:
    """Return how the query was sent: the coding without its parameters, or the pictures' way."""
    known = list(CODINGS)
    name = run.descriptor_coding.partition("(")[0]
    if not name or _is_damaged(run):
        rank, picture_way = way_of_pictures(run)
        return Way(len(known) + 1 + rank, picture_way)
    return Way(known.index(name) if name in known else len(known), name)


def _is_damaged(run: RunRecord) -> bool:
    """Say whether a descriptor was made of worse pictures than the robot's own."""
    return run.compression_query >= 0 or bool(run.video or run.jpeg_part)


def sending_artefacts(given: ChapterInput) -> tuple[Artefact, ...]:
    """Return the table of bytes at equal accuracy, and a figure for each dataset."""
    cases = sending_cases(given.records)
    if not cases:
        return ()
    table = ways_table(
        given,
        cases,
        "Bytes of a window at equal accuracy, descriptors and pictures",
        "The fewest bytes with an accuracy of at least the lower end of the interval of exact "
        "descriptors; beside it the bytes of a frame, JPEG's c or the video's crf. Exact "
        "descriptors take four bytes a number, of some techniques one. “sketch” needs nothing but "
        "a seed; “projected” needs the map's directions at the sender first, which are not in "
        "these bytes. Pictures need neither, serve any technique, and can be looked at.",
        "exact descriptors",
    )
    return table, *ways_figures(cases, "accuracy for the bytes of a window, descriptors, pictures")
