"""Numbers and sentences as a reader sees them."""

import math
from dataclasses import replace

import pytest
from tests.unit.reports.records import make_record

from retraverse.reports import wording

NARROW = "\u202f"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.00 µs"),
        (2.5e-6, "2.50 µs"),
        (0.00081, "810 µs"),
        (0.0123, "12.3 ms"),
        (0.5, "500 ms"),
        (1.0, "1.00 s"),
        (61.26, "61.3 s"),
        (1234.0, "1,234 s"),
        (math.nan, "–"),
        (None, "–"),
    ],
)
def test_seconds(value: float | None, text: str) -> None:
    assert wording.seconds(value).replace(NARROW, " ") == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.96, "96.0 %"), (1.0, "100.0 %"), (0.0, "0.0 %"), (math.nan, "–"), (None, "–")],
)
def test_percent(value: float | None, text: str) -> None:
    assert wording.percent(value).replace(NARROW, " ") == text


@pytest.mark.parametrize(
    ("value", "text"), [(10.0, "10"), (6.5, "6.5"), (100.0, "100"), (3.666, "3.67"), (None, "–")]
)
def test_plain(value: float | None, text: str) -> None:
    assert wording.plain(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(999, "999 bytes"), (123008, "123 kB"), (12_423_808, "12.4 MB")]
)
def test_bytes(value: int, text: str) -> None:
    assert wording.bytes_text(value).replace(NARROW, " ") == text


def test_subscripts_keep_hostile_text_harmless() -> None:
    assert wording.subscripts("t_VPR and R_P100") == "t<sub>VPR</sub> and R<sub>P100</sub>"
    assert wording.subscripts("<b>t_e</b>") == "&lt;b&gt;t<sub>e</sub>&lt;/b&gt;"
    assert wording.subscripts("my_parameter") == "my_parameter"


def test_headline_with_truth_says_located_correct_and_tolerance() -> None:
    record = make_record(40, 44, lengths=[3] * 40)
    accuracy = record.evaluation.accuracy if record.evaluation else math.nan
    expected = f"38 of 40 query frames located; {wording.percent(accuracy)} correct within ±1 frame"
    assert wording.headline(record) == expected


def test_headline_counts_refused_windows_as_not_located() -> None:
    record = make_record(40, 44, lengths=[1] * 40, tolerance=None, threshold=2.0)
    assert wording.headline(record) == "0 of 40 query frames located on a map of 44 frames"


def test_tolerance_of_zero_frames_and_of_no_frames() -> None:
    assert wording.tolerance(make_record(5, 5, tolerance=0)) == "to the frame"
    record = make_record(5, 5)
    assert record.truth is not None
    by_radius = replace(record.truth, tolerance_frames=None, description="within 25 m")
    assert wording.tolerance(replace(record, truth=by_radius)) == "(within 25 m)"


@pytest.mark.parametrize(
    ("lengths", "text"),
    [([7] * 20, "K = 7"), ([2, 3] * 10, "dynamic K, 2 to 3"), ([50] * 20, "K = 50")],
)
def test_length_text(lengths: list[int], text: str) -> None:
    assert wording.length_text(make_record(20, 24, lengths=lengths, tolerance=None)) == text
