"""Video instead of JPEG: what groups of pictures save at equal accuracy."""

from collections.abc import Iterable

from retraverse.images.codecs import GROUP_CODECS
from retraverse.reports.study_report.artefacts import Artefact
from retraverse.reports.study_report.chapters.beyond.ways import (
    Way,
    WayCase,
    way_cases,
    ways_figures,
    ways_table,
)
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.words import codec_title
from retraverse.studies.keeping.records import RunRecord

__all__ = ["JPEG", "video_artefacts", "video_cases", "way_of_pictures"]

JPEG = "JPEG"


def video_cases(records: Iterable[RunRecord]) -> list[WayCase]:
    """Return what there is to compare: settings that both video and JPEG files were tried with.

    JPEG files count if their map is the one of the video's runs.
    """
    return way_cases(records, JPEG, way_of_pictures, lambda run: bool(run.video))


def way_of_pictures(run: RunRecord) -> Way:
    """Return how the query's pictures were sent; "" if nobody would send them, or none were."""
    if run.descriptor_coding or run.jpeg_part:
        return Way(0, "")
    if run.video:
        known = list(GROUP_CODECS)
        rank = known.index(run.video) if run.video in known else len(known)
        return Way(1 + rank, f"{codec_title(run.video)}, groups of {run.group_length}")
    return Way(0, JPEG if run.compression_query >= 0 else "")


def video_artefacts(given: ChapterInput) -> tuple[Artefact, ...]:
    """Return the table of bytes at equal accuracy, and a figure for each dataset."""
    cases = video_cases(given.records)
    if not cases:
        return ()
    table = ways_table(
        given,
        cases,
        "Bytes of a window at equal accuracy, JPEG and video",
        "The fewest bytes with an accuracy of at least the lower end of the interval of the finest "
        "JPEG files; beside it the c of JPEG or the crf of the video. The map is as it is. A group "
        "can only be sent when its last picture is there.",
        "finest JPEG",
        with_saved=True,
    )
    return table, *ways_figures(cases, "accuracy for the bytes of a window, JPEG and video")
