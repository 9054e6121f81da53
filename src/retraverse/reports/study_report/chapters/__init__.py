"""One file or folder per chapter: which tables and figures it has, and the words around them."""

from collections.abc import Callable, Mapping

from retraverse.reports.study_report.artefacts import Chapter
from retraverse.reports.study_report.chapters.beyond import beyond
from retraverse.reports.study_report.chapters.chapter3 import chapter_3
from retraverse.reports.study_report.chapters.chapter4 import chapter_4
from retraverse.reports.study_report.chapters.chapter5 import chapter_5
from retraverse.reports.study_report.chapters.chapter6 import chapter_6
from retraverse.reports.study_report.chapters.chapter7 import chapter_7
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.chapters.free import free_plan

__all__ = ["CHAPTERS", "ChapterInput"]

CHAPTERS: Mapping[str, Callable[[ChapterInput], Chapter]] = {
    "3": chapter_3,
    "4": chapter_4,
    "5": chapter_5,
    "6": chapter_6,
    "7": chapter_7,
    "beyond": beyond,
    "runs": free_plan,
}
"""Key of a page -> what makes it; the order is the index's."""
