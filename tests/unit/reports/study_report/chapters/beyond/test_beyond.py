"""The page beyond the thesis: each question is answered from its own runs, in whatever order."""

import csv
import io
import random
from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.reports.study_report.chapters.beyond.plans import (
    CLEAN,
    MATCHERS,
    PART_ACCURACY,
    PARTS,
    all_runs,
    matcher_runs,
    part_runs,
    reading_runs,
    sending_runs,
    speed_runs,
    video_runs,
)
from tests.unit.reports.study_report.made_up import make_run, write_study
from tests.unit.reports.test_comparison_report import Page

from retraverse.reports import write_study_report
from retraverse.reports.study_report.chapters.beyond.chosen import (
    compared_matchers,
    driven_again,
    read_settings,
)
from retraverse.reports.study_report.chapters.beyond.found import beyond_findings
from retraverse.reports.study_report.chapters.beyond.parts import part_columns
from retraverse.reports.study_report.chapters.beyond.reading import character_distance
from retraverse.reports.study_report.chapters.beyond.sending import sending_cases
from retraverse.reports.study_report.chapters.beyond.video import JPEG, video_cases
from retraverse.studies.keeping.records import RunRecord

SECTIONS = (
    "Which matcher bears compression?",
    "At changing speed",
    "Which part of JPEG hurts?",
    "Video instead of JPEG",
    "Descriptors in few bytes",
    "What can still be read?",
)


VIDEO_WAYS = (JPEG, "H.265, groups of 8", "AV1, groups of 8")


@pytest.fixture(scope="module", name="report")
def _report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beyond")
    write_study(folder, [*all_runs(), *part_runs("campus_loop", loss=0.1)])
    return write_study_report(folder, folder / "report").parent


def exported(report: Path, start: str) -> list[dict[str, str]]:
    """Return the rows of the one table whose file begins so."""
    (path,) = (report / "exports/beyond").glob(f"{start}*.csv")
    return list(csv.DictReader(io.StringIO(path.read_text())))


def ids(runs: list[RunRecord]) -> set[str]:
    return {run.run_id for run in runs}


def test_every_question_has_its_section(report: Path) -> None:
    page = Page((report / "beyond.html").read_text())
    for section in SECTIONS:
        assert section in page.text
    assert "it says nothing about faces" in page.text
    assert "60 queries, ±2 frames" in page.text


@pytest.mark.parametrize(
    ("runs", "section"),
    [
        (matcher_runs(), SECTIONS[0]),
        (speed_runs(), SECTIONS[1]),
        (part_runs(), SECTIONS[2]),
        (video_runs(), SECTIONS[3]),
        (sending_runs(), SECTIONS[4]),
        (reading_runs(), SECTIONS[5]),
    ],
    ids=["matchers", "speeds", "parts", "video", "sending", "reading"],
)
def test_a_plan_alone_has_its_section_alone(
    tmp_path: Path, runs: list[RunRecord], section: str
) -> None:
    write_study(tmp_path, runs)
    out = write_study_report(tmp_path, tmp_path / "out").parent
    text = Page((out / "beyond.html").read_text()).text
    assert [name for name in SECTIONS if name in text] == [section]


@pytest.mark.parametrize("seed", range(3))
def test_runs_are_told_by_what_they_are(seed: int) -> None:
    runs = list(all_runs())
    random.Random(seed).shuffle(runs)
    assert ids(compared_matchers(runs)) == ids(matcher_runs())
    assert ids(driven_again(runs)) == ids(speed_runs())
    assert ids(read_settings(runs)) == ids(reading_runs())
    parts = [run for one in part_columns(runs) for run in (one.clean, *one.damaged.values())]
    assert ids(parts) == ids(part_runs())
    sent = [run for case in video_cases(runs) for of in case.by_way.values() for run in of]
    assert ids(sent) == ids(video_runs())
    sent = [run for case in sending_cases(runs) for of in case.by_way.values() for run in of]
    assert ids(sent) == ids([*sending_runs(), *video_runs()])


def test_the_page_does_not_depend_on_the_order_of_records(report: Path, tmp_path: Path) -> None:
    runs = [*all_runs(), *part_runs("campus_loop", loss=0.1)]
    write_study(tmp_path, runs[::-1])
    other = write_study_report(tmp_path, tmp_path / "out").parent
    for path in (report / "exports/beyond").glob("*.csv"):
        there = other / "exports/beyond" / path.name
        assert sorted(there.read_text().splitlines()) == sorted(path.read_text().splitlines())


def test_parts_are_compared_with_clean_pictures(report: Path) -> None:
    rows = exported(report, "one-part-of-jpeg-at-c-97-corridor")
    assert [row["Part"] for row in rows] == 2 * ["clean", "all of JPEG", *PARTS]
    assert list(rows[0])[3:] == ["cohog", "hog"]  # those for a moved viewpoint first
    for row in rows:
        wanted = {"clean": CLEAN, "all of JPEG": PART_ACCURACY[""], **PART_ACCURACY}[row["Part"]]
        assert float(row["hog"]) == pytest.approx(wanted)
    text = Page((report / "beyond.html").read_text()).text
    assert "Compared across viewpoints: cohog." in text
    assert "Wanting the same viewpoint: hog." in text
    assert "(−35.0)" in text  # all of JPEG against clean pictures, hog on the corridor


def test_parts_of_several_datasets_have_a_mean(report: Path) -> None:
    rows = exported(report, "one-part-of-jpeg-at-c-97-mean-of-2-datasets")
    grid = next(row for row in rows if row["Part"] == "grid")
    assert float(grid["hog"]) == pytest.approx((0.7 + 0.6) / 2)
    points = exported(report, "what-each-part-of-jpeg")
    at_grid = [float(row["y"]) for row in points if (row["x"], row["line"]) == ("grid", "hog")]
    assert at_grid == pytest.approx(2 * [100 * (0.65 - CLEAN)])


def test_video_is_compared_at_equal_accuracy(report: Path) -> None:
    rows = {row["K"]: row for row in exported(report, "bytes-of-a-window-at-equal-accuracy-jpeg")}
    assert list(rows) == ["5", "10"]
    row = rows["10"]
    # 0.90 less half the interval is 0.85: c = 90 and crf 40 are enough, AV1's 0.7 is not.
    assert float(row["JPEG: bytes"]) == pytest.approx(20_000)
    assert float(row["H.265, groups of 8: bytes"]) == pytest.approx(5000)
    assert float(row["H.265, groups of 8: saved"]) == pytest.approx(0.75)
    assert row["AV1, groups of 8: bytes"] == "none"
    assert row["AV1, groups of 8: saved"] == "–"


def test_video_figures_have_a_line_for_each_codec(report: Path) -> None:
    points = exported(report, "corridor-accuracy-for-the-bytes-of-a-window-jpeg")
    assert {row["line"] for row in points} == set(VIDEO_WAYS)
    cheapest = next(row for row in points if row["line"] == "H.265, groups of 8")
    assert float(cheapest["x"]) == pytest.approx(2.5)  # 5 pictures of 500 bytes
    page = Page((report / "beyond.html").read_text())
    panels = [tag for _, tag in page.tags if tag.get("class") == "panel"]
    assert any(panel.get("data-technique") == "hog" for panel in panels)


def test_descriptors_are_compared_with_pictures(report: Path) -> None:
    rows = {
        row["K"]: row for row in exported(report, "bytes-of-a-window-at-equal-accuracy-descriptors")
    }
    assert list(rows) == ["5", "10"]
    row = rows["10"]
    # 0.92 less half the interval is 0.87: int8 and the long sketch are enough, and JPEG at c = 0.
    assert float(row["Accuracy, exact descriptors"]) == pytest.approx(0.92)
    assert float(row["exact: bytes"]) == pytest.approx(40_000)
    assert float(row["int8: bytes"]) == pytest.approx(10_040)
    assert float(row["sketch: bytes"]) == pytest.approx(1320)
    assert row["projected: bytes"] == "none"
    assert float(row["JPEG: bytes"]) == pytest.approx(100_000)
    assert list(row)[3:] == [
        "Accuracy, exact descriptors",
        *(f"{name}: bytes" for name in ("exact", "int8", "sketch", "projected", *VIDEO_WAYS)),
    ]
    lines = {
        row["line"]
        for row in exported(report, "corridor-accuracy-for-the-bytes-of-a-window-descriptors")
    }
    assert lines == {"exact", "int8", "sketch", "projected", *VIDEO_WAYS}


def test_each_map_is_compared_by_itself() -> None:
    """A compressed map, whose exact descriptors are worse, is another case."""
    worse = [
        replace(run, compression_reference=97, accuracy=run.accuracy / 2, run_id=f"w{run.run_id}")
        for run in sending_runs()
    ]
    for order in (1, -1):
        runs = [*sending_runs(), *video_runs(), *worse][::order]
        cases = [case for case in sending_cases(runs) if case.length == "10"]
        assert [case.finest.accuracy for case in cases] == [0.92, 0.46]
        assert ["JPEG" in case.by_way for case in cases] == [True, False]


@pytest.mark.parametrize("seed", range(3))
def test_parts_are_not_those_of_descriptors(seed: int) -> None:
    others = [
        replace(run, descriptor_coding="int8", accuracy=0.01, run_id=f"c{run.run_id}")
        for run in part_runs()
    ]
    runs = [*part_runs(), *others]
    random.Random(seed).shuffle(runs)
    parts = [run for one in part_columns(runs) for run in (one.clean, *one.damaged.values())]
    assert ids(parts) == ids(part_runs())


def test_descriptors_of_compressed_pictures_are_not_compared() -> None:
    damaged = [replace(run, compression_query=50) for run in sending_runs()]
    assert sending_cases(damaged) == []


def test_codings_are_found_by_their_bytes() -> None:
    said = beyond_findings([*sending_runs(), *video_runs()])["corridor"]
    assert "weighs, by technique: exact 40.0 kB; " in said.replace("\u202f", " ")
    assert "sketch 1.32 kB; projected none; JPEG 100 kB" in said.replace("\u202f", " ")
    assert said.count("(K = 10)") == 1


def test_jpeg_of_another_map_is_no_rival_of_video() -> None:
    others = [make_run(length="10", resize=256, compression=(c, c)) for c in (0, 99)]
    found = video_cases([*video_runs(), *others])
    assert ids([run for case in found for run in case.by_way[JPEG]]).isdisjoint(ids(others))
    assert video_cases([run for run in video_runs() if run.video]) == []


def test_what_can_be_read_has_its_distance(report: Path) -> None:
    rows = exported(report, "corridor-what-can-be-read")
    assert [row["Side"] for row in rows] == ["256", "64", "16"]
    assert [row["Legible height"] for row in rows] == ["0.02", "0.1", "none"]
    # 75 mm / (2 tan 30 degrees x 0.1 of the side)
    assert float(rows[1]["Distance"]) == pytest.approx(0.6495, abs=1e-4)
    assert float(rows[1]["hog"]) == pytest.approx(0.8)
    assert character_distance(0.05) == pytest.approx(2 * character_distance(0.1))


def test_what_was_not_measured_was_not_read() -> None:
    unmeasured = [make_run(resize=16, study="another plan")]
    assert read_settings(unmeasured) == []
    assert ids(read_settings([*unmeasured, *reading_runs()])) == ids(reading_runs())


def test_speeds_stand_beside_the_drive_as_recorded(report: Path) -> None:
    rows = exported(report, "matchers-at-changing-speed-mean")
    assert [row["Speed"] for row in rows] == ["constant speed", "varying speed", "with stops"]
    assert [float(row["mean"]) for row in rows] == pytest.approx([0.85, 0.65, 0.45])
    assert [float(row["dtw"]) for row in rows] == pytest.approx([0.85, 0.85, 0.85])
    table = exported(report, "corridor-every-technique-and-matcher-at-every-speed")
    assert len(table) == 2 * len(MATCHERS)
    hog = next(row for row in table if (row["Technique"], row["Matcher"]) == ("hog", "mean"))
    assert float(hog["with stops"]) == pytest.approx(0.5)


def test_a_matcher_that_missed_a_technique_has_no_mean_at_any_speed(tmp_path: Path) -> None:
    runs = [run for run in speed_runs() if (run.matcher, run.technique) != ("dtw", "hog")]
    write_study(tmp_path, runs)
    out = write_study_report(tmp_path, tmp_path / "out").parent
    rows = exported(out, "matchers-at-changing-speed-mean")
    assert {row["dtw"] for row in rows} == {"–"}
    assert "–" not in {row["mean"] for row in rows}


def test_findings_answer_each_question() -> None:
    found = beyond_findings(all_runs())
    assert set(found) == {"corridor", "corridor, varying speed", "corridor, with stops"}
    text = found["corridor"].replace("\u202f", " ")
    assert text.startswith("at c = 97 “dtw” answers best, 75.0 % (mean over 2 techniques); ")
    assert "c = 97 “luminance” alone changes most: −35.0 points, all of JPEG −40.0 (K = 1" in text
    assert "H.265, groups of 8 saves 75 to 75 % of JPEG's bytes" in text
    assert "AV1, groups of 8 saves" not in text
    assert "in which nothing can be read (16 px), hog still recognises 95.0 %" in text
    assert "“dtw” answers best, 85.0" in found["corridor, with stops"]


def test_findings_of_ordinary_runs_are_none() -> None:
    assert beyond_findings([make_run(length=k, chapter="beyond") for k in ("1", "5")]) == {}
