"""The page of what goes beyond the thesis: one section for each question that its runs answer."""

from retraverse.reports.study_report.artefacts import Chapter, Section
from retraverse.reports.study_report.chapters.beyond.chosen import compared_matchers
from retraverse.reports.study_report.chapters.beyond.matchers import matcher_means, matcher_tables
from retraverse.reports.study_report.chapters.beyond.parts import part_artefacts
from retraverse.reports.study_report.chapters.beyond.reading import CAUTION, reading_artefacts
from retraverse.reports.study_report.chapters.beyond.sending import sending_artefacts
from retraverse.reports.study_report.chapters.beyond.speeds import speed_artefacts
from retraverse.reports.study_report.chapters.beyond.video import video_artefacts
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.chapters.free import free_sections

__all__ = ["beyond"]


def beyond(given: ChapterInput) -> Chapter:
    """Return the page of what the thesis names as future work, and what we added."""
    sections = tuple(section for section in _sections(given) if section.artefacts)
    return Chapter(
        "beyond",
        "Beyond the thesis",
        "Which way of matching a sequence bears compression and changes of speed best, what in "
        "JPEG hurts, what would video save, or descriptors in few bytes, and what can still be "
        "read in such pictures? The thesis names some of this as future work.",
        sections or free_sections(given),
        given.records,
    )


def _sections(given: ChapterInput) -> tuple[Section, ...]:
    matched = compared_matchers(given.records)
    return (
        Section("Which matcher bears compression?", matcher_means(matched)),
        Section("Every technique with every matcher", matcher_tables(matched)),
        Section(
            "At changing speed",
            speed_artefacts(given.records),
            "The query drawn again from the recorded drive, frame by frame, at another speed; the "
            "map stays. Matchers that expect one speed lose what others keep.",
        ),
        Section(
            "Which part of JPEG hurts?",
            part_artefacts(given.records),
            "One part of JPEG's damage is done to clean pictures, all others are left out; the "
            "part that costs as much as the whole file is the one to avoid.",
        ),
        Section(
            "Video instead of JPEG",
            video_artefacts(given),
            "The query sent as groups of pictures of a video codec, the map as it is: what "
            "consecutive pictures have in common is sent once.",
        ),
        Section(
            "Descriptors in few bytes",
            sending_artefacts(given),
            "The thesis sends pictures because descriptors are large: four bytes for each of "
            "thousands of numbers. Here they are rounded, sketched or projected before they are "
            "sent; the map keeps its own as they are.",
        ),
        Section("What can still be read?", reading_artefacts(given.records), CAUTION),
    )
