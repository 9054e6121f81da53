"""Video instead of JPEG: what groups of pictures save at equal accuracy."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from retraverse.images.codecs import GROUP_CODECS
from retraverse.reports.study_report.artefacts import Artefact, Cell, Figure, Line, Panel, Table
from retraverse.reports.study_report.chapters.beyond.chosen import settings_with
from retraverse.reports.study_report.chapters.context import ChapterInput, long_table
from retraverse.reports.study_report.chapters.data_of_answers import frontier
from retraverse.reports.study_report.choices import cheapest
from retraverse.reports.study_report.figures import PERCENT
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Runs, Series, SeriesBook, place_of
from retraverse.reports.study_report.words import (
    codec_title,
    dataset_title,
    meanings,
    measured_on,
    size_text,
)
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord

__all__ = ["JPEG", "VideoCase", "video_artefacts", "video_cases"]

JPEG = "JPEG"


@dataclass(frozen=True)
class VideoCase:
    """One technique with one K on one dataset, its query sent in every way."""

    series: Series
    dataset: str
    length: str
    by_codec: Mapping[str, Sequence[RunRecord]]
    """"JPEG" first, then "AV1, groups of 8" and so on."""

    @property
    def finest(self) -> RunRecord:
        """Return the run of the JPEG files that are compressed least."""
        return min(self.by_codec[JPEG], key=lambda run: run.compression_query)

    def cheapest(self, codec: str) -> RunRecord | None:
        """Return the run of fewest bytes that is not shown to be worse than the finest JPEG."""
        return cheapest(self.by_codec.get(codec, ()), self.finest.accuracy_low, data_per_answer)


def video_cases(records: Iterable[RunRecord]) -> list[VideoCase]:
    """Return what there is to compare: settings that both video and JPEG files were tried with.

    JPEG files count if their map is the one of the video's runs.
    """
    groups = settings_with(records, lambda run: bool(run.video))
    plain = [
        replace(run, video="", group_length=0, encoder="")
        for runs in groups.values()
        for run in runs
    ]
    named = Runs(plain, SeriesBook({}))
    cases = []
    for runs in groups.values():
        of_map = {run.compression_reference for run in runs if run.video}
        by_codec: dict[str, list[RunRecord]] = {}
        for run in sorted(runs, key=_order):
            if run.compression_reference in of_map and (name := _codec(run)):
                by_codec.setdefault(name, []).append(run)
        if JPEG in by_codec:
            first = runs[0]
            cases.append(
                VideoCase(named.series_of(first), first.dataset, first.sequence_length, by_codec)
            )
    return cases


def _order(run: RunRecord) -> tuple[int, int, int, int]:
    """Return what runs of a case are sorted by: JPEG first, then the older codec."""
    codecs = ["", *GROUP_CODECS]
    known = codecs.index(run.video) if run.video in codecs else len(codecs)
    return known, run.group_length, run.compression_query, run.video_quality


def _codec(run: RunRecord) -> str:
    """Return how the query was sent, "" for pictures that nobody would send."""
    if run.video:
        return f"{codec_title(run.video)}, groups of {run.group_length}"
    return JPEG if run.compression_query >= 0 and not run.jpeg_part else ""


def video_artefacts(given: ChapterInput) -> tuple[Artefact, ...]:
    """Return the table of bytes at equal accuracy, and a figure for each dataset."""
    cases = video_cases(given.records)
    if not cases:
        return ()
    codecs = list(dict.fromkeys(name for case in cases for name in case.by_codec))
    book = SeriesBook({})
    for name in codecs:
        book.get(name, "")
    datasets = list(dict.fromkeys(case.dataset for case in cases))
    return (
        _table(given, cases, codecs),
        *(_figure([case for case in cases if case.dataset == one], book) for one in datasets),
    )


def _figure(cases: Sequence[VideoCase], book: SeriesBook) -> Figure:
    """Return accuracy over the bytes of a window, a panel for each technique of a dataset."""
    by_technique: dict[Series, list[VideoCase]] = {}
    for case in cases:
        by_technique.setdefault(case.series, []).append(case)
    return Figure(
        "",
        f"{dataset_title(cases[0].dataset)}: accuracy for the bytes of a window, JPEG and video",
        tuple(_panel(series, some, book) for series, some in sorted(by_technique.items())),
        "Every mix of quality and K that no cheaper mix of the same codec beats. Higher and "
        "further to the left is better.",
        meanings("accuracy", "group bytes", "K"),
    )


def _panel(series: Series, cases: Sequence[VideoCase], book: SeriesBook) -> Panel:
    lines = []
    for codec in cases[0].by_codec:
        found = frontier(
            (data_per_answer(run) / 1000, 100 * run.accuracy, run)
            for case in cases
            for run in case.by_codec.get(codec, ())
        )
        x, y, runs = zip(*found, strict=True) if found else ((), (), ())
        lines.append(Line(book.get(codec, ""), x, y, runs))
    drawn = draw_lines(
        series.label,
        measured_on(cases[0].finest),
        lines,
        name=f"video {cases[0].dataset}",
        x_label="Bytes of a window, kB",
        y_label="Accuracy, %",
        is_log=(True, False),
        y_limits=PERCENT,
    )
    return replace(drawn, technique=series.technique)


def _table(given: ChapterInput, cases: Sequence[VideoCase], codecs: Sequence[str]) -> Table:
    rows = [(case.series, case.finest, _cells(case, codecs)) for case in cases]
    videos = codecs[1:]
    return long_table(
        given,
        rows,
        number="",
        title="Bytes of a window at equal accuracy, JPEG and video",
        head=(
            "K",
            "Accuracy, finest JPEG",
            *(f"{name}: bytes" for name in codecs),
            *(f"{name}: saved" for name in videos),
        ),
        caption="The fewest bytes with an accuracy of at least the lower end of the interval of "
        "the finest JPEG files; beside it the c of JPEG or the crf of the video. The map is as it "
        "is. A group can only be sent when its last picture is there.",
        definitions=meanings("accuracy", "interval", "group bytes", "K", "c"),
    )


def _cells(case: VideoCase, codecs: Sequence[str]) -> tuple[Cell, ...]:
    chosen = {name: case.cheapest(name) for name in codecs}
    bytes_of = {
        name: math.nan if run is None else data_per_answer(run) for name, run in chosen.items()
    }
    finest = case.finest
    interval = f"({100 * finest.accuracy_low:.0f} to {100 * finest.accuracy_high:.0f})"
    return (
        Cell(case.length, finest.mean_sequence_length),
        Cell(f"{100 * finest.accuracy:.1f} %", finest.accuracy, finest, note=interval),
        *(_bytes(run, bytes_of[name]) for name, run in chosen.items()),
        *(_saved(bytes_of[name], bytes_of[JPEG]) for name in codecs[1:]),
    )


def _bytes(run: RunRecord | None, value: float) -> Cell:
    if run is None:
        return Cell("none", math.inf)
    place = place_of(run)
    return Cell(
        size_text(value),
        value,
        run,
        note=place.query_text if place.is_video else f"c = {place.query_text}",
    )


def _saved(ours: float, theirs: float) -> Cell:
    share = 1 - ours / theirs if theirs > 0 else math.nan
    return Cell(NOTHING, math.nan) if math.isnan(share) else Cell(f"{100 * share:,.0f} %", share)
