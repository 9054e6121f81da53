"""Each expectation holds, fails with its exceptions, or cannot be told."""

from collections.abc import Iterable
from dataclasses import replace

import pytest
from tests.unit.reports.study_report.made_up import make_run

from retraverse.studies.judging.expectations import Expectation, check_expectations
from retraverse.studies.keeping.records import RunRecord

NAMES = (
    "accuracy-rises",
    "bytes-fall",
    "smaller-than-descriptor",
    "data-fall",
    "orb-needs-size",
    "time-falls",
)


def judged(name: str, runs: Iterable[RunRecord]) -> Expectation:
    return {found.name: found for found in check_expectations(runs)}[name]


def lengths(*accuracies: float, n_windows: int = 100) -> list[RunRecord]:
    return [
        replace(make_run(length=str(k)), accuracy=accuracy, n_windows=n_windows)
        for k, accuracy in enumerate(accuracies, 1)
    ]


def compressed(*sizes: float, length: str = "1", **others: float) -> list[RunRecord]:
    """Return runs at c = 0, 60, 90 with these bytes a picture, all of 256 px."""
    return [
        replace(
            make_run(length=length, compression=(c, c), resize=256),
            query_bytes_mean=size,
            query_bytes_total=round(size * 60),
            reference_bytes_total=round(size * 60),
            **others,  # type: ignore[arg-type]
        )
        for c, size in zip((0, 60, 90), sizes, strict=False)
    ]


def test_nothing_is_told_of_nothing() -> None:
    found = check_expectations([])
    assert tuple(item.name for item in found) == NAMES
    assert {item.verdict for item in found} == {"not tested"}
    assert {item.numbers for item in found} == {"no record can tell"}


@pytest.mark.parametrize(
    ("accuracies", "holds"),
    [
        ((0.3, 0.5, 0.9), True),
        ((0.3, 0.3), True),
        ((0.5, 0.495, 0.9), True),  # less than one window of 100
        ((0.5, 0.3, 0.9), False),
    ],
)
def test_accuracy_rises(accuracies: tuple[float, ...], holds: bool) -> None:
    assert judged("accuracy-rises", lengths(*accuracies)).holds is holds


def test_a_fall_of_accuracy_is_named() -> None:
    found = judged("accuracy-rises", lengths(0.5, 0.3, 0.9))
    assert found.verdict == "does not hold"
    (exception,) = found.exceptions
    assert exception == (
        "hog on corridor: 1 fall, the largest 20.0 points from K = 1 (50.0 %) to K = 2 (30.0 %)"
    )
    assert "0 of 1 cases agree" in found.numbers
    assert "in 1 of 1" in found.numbers


@pytest.mark.parametrize(
    ("sizes", "holds"), [((9000, 4000, 900), True), ((9000, 900, 900), False), ((9000,), None)]
)
def test_bytes_fall(sizes: tuple[float, ...], holds: bool | None) -> None:
    assert judged("bytes-fall", compressed(*sizes)).holds is holds


@pytest.mark.parametrize(
    ("sizes", "holds"),
    [((90_000, 16_383, 900), True), ((90_000, 16_384, 900), False), ((10_000,), None)],
)
def test_pictures_against_netvlads_descriptor(sizes: tuple[float, ...], holds: bool | None) -> None:
    assert judged("smaller-than-descriptor", compressed(*sizes)).holds is holds


def test_data_fall_although_k_grows() -> None:
    small = compressed(9000.0, length="2", accuracy=1.0)[:1]
    large = compressed(9000.0, 4000.0, 900.0, length="5", accuracy=1.0)[1:]
    found = judged("data-fall", [*small, *large])
    assert found.holds is False  # 2 x 9 kB < 5 x 4 kB
    assert found.exceptions[0].endswith("18.0 kB at c = 0 with K = 2, 20.0 kB at c = 60 with K = 5")
    assert "K is larger at the highest c than at the lowest in 1 of 1" in found.numbers
    assert judged("data-fall", [small[0], large[1]]).holds is True


def test_orb_below_128_pixels() -> None:
    def run(size: int, share: float) -> RunRecord:
        return replace(make_run(technique="orb", resize=size), no_descriptor_share=share)

    blind = [run(16, 1.0), run(64, 0.6), run(128, 0.0)]
    assert judged("orb-needs-size", blind).holds is True
    seeing = judged("orb-needs-size", [*blind[:1], run(64, 0.1)])
    assert seeing.holds is False
    assert seeing.exceptions == (
        "corridor, 64 px: 10.0 % of the query pictures without a keypoint",
    )
    assert judged("orb-needs-size", blind[2:]).holds is None


def test_time_falls_with_resolution() -> None:
    falling = [replace(make_run(resize=size), vpr_s=size / 1000) for size in (256, 16, 64)]
    assert judged("time-falls", falling).holds is True
    slow = replace(falling[1], vpr_s=0.3)
    found = judged("time-falls", [falling[0], slow, falling[2]])
    assert found.holds is False
    assert found.exceptions == ("hog on corridor: 64 ms at 64 px, 300 ms at 16 px",)


def test_failed_runs_do_not_count() -> None:
    runs = [replace(run, status="failed") for run in lengths(0.9, 0.1)]
    assert judged("accuracy-rises", runs).holds is None


@pytest.mark.parametrize(
    "beyond",
    [
        {"jpeg_part": "grid"},
        {"video": "av1", "video_quality": 40},
        {"descriptor_coding": "int8"},
        {"chapter": "beyond"},
    ],
)
def test_what_the_thesis_does_not_speak_of_does_not_count(beyond: dict[str, object]) -> None:
    rises = lengths(0.5, 0.6)
    falls = [replace(run, **beyond) for run in lengths(0.9, 0.1)]  # type: ignore[arg-type]
    assert judged("accuracy-rises", [*rises, *falls]) == judged("accuracy-rises", rises)
    raw = [replace(run, query_bytes_mean=1e6, **beyond) for run in compressed(9000, 4000)]  # type: ignore[arg-type]
    assert judged("bytes-fall", [*raw, *compressed(9000, 4000)]).holds
