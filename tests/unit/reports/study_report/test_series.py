"""Lines: runs that differ in what was done to their pictures are never on one line and place."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from tests.unit.reports.study_report.made_up import make_run

from retraverse.reports.study_report.choices import choices_table, frame_seconds
from retraverse.reports.study_report.pictures_only import picture_runs
from retraverse.reports.study_report.run_files import run_address
from retraverse.reports.study_report.series import Runs, SeriesBook, is_whole, place_of
from retraverse.reports.study_report.words import place_text
from retraverse.studies.keeping.records import RunRecord

WHOLE = make_run(compression=(97, 97))
PART = make_run(compression=(97, 97), jpeg_part="grid")
OTHER_PART = make_run(compression=(97, 97), jpeg_part="means")
VIDEO = make_run(video="h265", video_quality=36, group_length=8)
COARSER = make_run(video="h265", video_quality=44, group_length=8)
LONGER = make_run(video="h265", video_quality=36, group_length=16)
OTHER_CODEC = make_run(video="av1", video_quality=36, group_length=8)
PLAIN = make_run()
CODED = make_run(descriptor_coding="int8")
SKETCHED = make_run(descriptor_coding="sketch(bits=64)")
ALL = (WHOLE, PART, OTHER_PART, VIDEO, COARSER, LONGER, OTHER_CODEC, PLAIN, CODED, SKETCHED)


def labels(runs: Sequence[RunRecord]) -> list[str]:
    grouped = Runs(runs, SeriesBook({}))
    return [grouped.series_of(run).label for run in runs]


def test_no_two_of_them_share_a_line_and_a_place() -> None:
    runs = Runs(ALL, SeriesBook({}))
    for series in runs.series:
        for place in runs.places_of(series, "corridor"):
            assert len(runs.at(series, "corridor", place)) == 1
    assert len({run_address(run) for run in ALL}) == len(ALL)
    assert len({place_text(run) for run in ALL}) == len(ALL)
    # How descriptors are sent does not change the pictures.
    assert len(picture_runs(ALL)) == len(ALL) - 2


def test_lines_say_what_was_done() -> None:
    assert labels([WHOLE, PART, VIDEO, LONGER, OTHER_CODEC, SKETCHED]) == [
        "hog",
        "hog, grid alone",
        "hog, H.265 in groups of 8",
        "hog, H.265 in groups of 16",
        "hog, AV1 in groups of 8",
        "hog, sent as sketch(bits=64)",
    ]
    # One quality after the other is one line.
    assert len(set(labels([VIDEO, COARSER]))) == 1


@pytest.mark.parametrize(
    ("run", "text"),
    [
        (WHOLE, "c = 97"),
        (PART, "c = 97, grid alone"),
        (SKETCHED, "sent as sketch(bits=64)"),
        (VIDEO, "query as H.265 crf 36, groups of 8, map as is"),
        (replace(VIDEO, compression_reference=50, resize=256),
         "query as H.265 crf 36, groups of 8, map c = 50, 256 px"),
        (PLAIN, "pictures as they are"),
    ],
)  # fmt: skip
def test_places_in_words(run: RunRecord, text: str) -> None:
    assert place_text(run) == text


def test_only_jpeg_alike_is_uniform() -> None:
    assert place_of(WHOLE).is_uniform
    assert not place_of(VIDEO).is_uniform
    assert not place_of(VIDEO).is_mixed
    assert place_of(make_run(compression=(0, 97))).is_mixed
    assert [run for run in ALL if is_whole(run)] == [WHOLE, PLAIN]


def test_descriptors_are_a_choice_by_bytes_and_not_by_time() -> None:
    coded = make_run(descriptor_coding="sketch", coded_bytes=10, encode_s=1e-6)
    runs = [replace(run, accuracy=0.97) for run in (coded, WHOLE)]
    chosen = [row for row in choices_table(runs).rows if not row.absent]
    by_bytes = [row for row in chosen if "bytes" in row.cells[2].text]
    assert {row.cells[5].text for row in by_bytes} == {"sketch"}
    assert {row.cells[5].text for row in chosen if row not in by_bytes} == {"97"}
    assert math.isnan(frame_seconds(coded))
    timed = replace(coded, encode_s=0.5, match_s=0.25, coding_s=0.125)
    assert frame_seconds(timed) == 0.875
    # What must be known before is said where anything must.
    assert "before the first" not in choices_table(runs).caption
    learned = choices_table([replace(runs[0], coding_shared_bytes=1_240_000), runs[1]])
    assert "before the first" in learned.caption
    reached = [row for row in learned.rows if not row.absent]
    notes = {row.cells[7].note for row in reached if row.cells[5].text != "97"}
    assert notes == {"+ 1.24\u202fMB"}


def test_one_part_of_jpeg_is_no_choice_and_video_is_one() -> None:
    part = replace(PART, accuracy=1.0, query_bytes_mean=1.0, encode_s=1e-6)
    video = replace(VIDEO, accuracy=0.97, query_bytes_mean=100.0)
    again = replace(WHOLE, dataset="corridor, with stops", accuracy=1.0)
    rows = choices_table([part, video, again, replace(WHOLE, accuracy=0.97)]).rows
    assert {row.cells[0].text for row in rows} == {"Corridor"}
    chosen = [row for row in rows if not row.absent]
    opened = {cell.run.run_id for row in chosen for cell in row.cells if cell.run is not None}
    assert video.run_id in opened
    assert part.run_id not in opened
    (compression,) = {row.cells[5].text for row in chosen if "bytes" in row.cells[2].text}
    assert compression == "H.265 crf 36"
