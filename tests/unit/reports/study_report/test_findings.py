"""What a page begins with: sentences made from the numbers of runs that are known."""

import math
from dataclasses import replace

import pytest
from tests.unit.reports.study_report.made_up import chapter_runs, make_run

from retraverse.reports.study_report.findings import findings, tells_interval
from retraverse.studies.keeping.records import RunRecord


def run(
    technique: str, accuracy: float, length: str = "1", c: int = -1, **others: object
) -> RunRecord:
    """Return a run of exactly one accuracy."""
    made = make_run("corridor", technique, length, accuracy=accuracy, compression=(c, c))
    low, high = accuracy - 0.05, min(1.0, accuracy + 0.05)
    values = {"accuracy": accuracy, "accuracy_low": low, "accuracy_high": high}
    return replace(made, **values, **others)  # type: ignore[arg-type]


def text(key: str, records: list[RunRecord]) -> str:
    ((dataset, found),) = findings(key, records)
    assert dataset == "Corridor"
    return found.replace("\u202f", " ")


def test_chapter_3_says_what_is_best_and_what_comes_next() -> None:
    found = text("3", [run("hog", 0.6), run("convsequential", 0.9, "10"), run("cohog", 0.7)])
    assert found.startswith("most accurate is convsequential, K = 10, with 90.0 % (85 to 95)")
    assert "; then cohog, with 70.0 %" in found


def test_chapter_4_says_the_first_and_the_fastest_way_to_100_per_cent() -> None:
    records = [
        run("hog", 0.6),
        run("hog", 1.0, "5", vpr_s=0.5),
        run("cohog", 0.5),
        run("cohog", 1.0, "10", vpr_s=0.01),
    ]
    found = text("4", records)
    assert found.startswith("of single frames hog")
    assert "100 % comes first with hog, K = 5 (t_VPR 500 ms)" in found
    assert found.endswith("in the least time with cohog, K = 10 (10.0 ms).")
    short = text("4", [run("hog", 0.6), run("hog", 0.8, "5")])
    assert "no K reaches 100 %, the nearest is hog, K = 5, with 80.0 %" in short


def test_chapter_5_follows_the_best_line_down() -> None:
    records = [
        run("hog", 0.8, c=0, query_bytes_total=120_000, reference_bytes_total=0),
        run("hog", 0.76, c=50),
        run("hog", 0.4, c=90),
        run("cohog", 0.79, c=99),
    ]
    found = text("5", records)
    assert "the best falls from 80.0 % (hog) to 79.0 % (cohog)" in found
    # At c = 99 it is within the interval again, but not all the way up to it.
    assert "Up to c = 50 the best stays above 75.0 %" in found


def test_chapter_6_says_how_many_bytes_compression_saves() -> None:
    records = [
        run("hog", 1.0, "5", c=0, query_bytes_mean=10_000.0),
        run("hog", 1.0, "10", c=99, query_bytes_mean=500.0),
        run("hog", 0.9, "5", c=99, query_bytes_mean=500.0),
    ]
    found = text("6", records)
    assert found.startswith("fewest bytes for 100 %: 5.00 kB a window by hog, K = 10, c = 99")
    assert "at c = 0 the fewest are 50.0 kB (hog, K = 5), 10.0 times as many" in found
    assert text("6", records[2:]).startswith("no mix reaches 100 %; the nearest is hog, K = 5")


def test_chapter_7_names_the_smallest_picture_within_the_interval() -> None:
    records = [run("hog", accuracy, resize=size) for size, accuracy in ((16, 0.2), (64, 0.88),
                                                                       (256, 0.9))]  # fmt: skip
    found = text("7", records)
    assert "most accurate is hog, 256 px" in found
    assert "the smallest picture is hog, 64 px, with 88.0 %" in found


def test_beyond_compares_the_matchers_at_the_highest_compression() -> None:
    records = [
        run(technique, accuracy, "10", c=c, matcher=matcher)
        for technique, shift in (("hog", 0.0), ("cohog", 0.1))
        for c, loss in ((0, 0.0), (99, 0.3))
        for matcher, base in (("mean", 0.6), ("dtw", 0.8))
        for accuracy in [base + shift - loss]
    ]
    found = text("beyond", records)
    assert "at c = 99 “dtw” answers best, 55.0 % (mean over 2 techniques)" in found
    assert "the thesis' mean of a sequence has 35.0 %" in found
    alike = [replace(one, accuracy=0.5) for one in records]
    assert "all matchers answer alike" in text("beyond", alike)


@pytest.mark.parametrize("key", ["3", "4", "5", "6", "7", "beyond", "runs"])
def test_every_page_has_a_finding_for_every_dataset_or_none(key: str) -> None:
    records = chapter_runs(key if key.isdigit() else "")
    found = [dataset for dataset, _ in findings(key, records)]
    assert sorted(found) == ["Campus Loop", "Corridor"]
    assert findings(key, []) == ()
    assert findings(key, [replace(records[0], accuracy=math.nan)]) == ()


def test_an_interval_is_known_by_its_brackets() -> None:
    assert tells_interval("hog, with 90.0 % (85 to 95)")
    assert not tells_interval("from c = 0 to 99 (14 kB to 1 kB a picture)")
