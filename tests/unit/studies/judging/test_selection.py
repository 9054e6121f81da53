"""The selection rules: two people who follow them draw the same figure."""

import math
from dataclasses import replace

import pytest
from tests.unit.reports.study_report.made_up import make_run

from retraverse.studies.judging.selection import (
    boost,
    condition_of,
    curves_of,
    data_per_answer,
    largest_within,
    least_data,
    mean_bytes,
    per_compute_unit,
    smallest_length,
)
from retraverse.studies.keeping.records import RunRecord


def curve(*accuracies: float, seconds: float = 0.1) -> tuple[RunRecord, ...]:
    """Return runs with K = 1, 2, ... of these accuracies; t_VPR is K times `seconds`."""
    return tuple(
        replace(make_run(length=str(k)), accuracy=accuracy, vpr_s=k * seconds)
        for k, accuracy in enumerate(accuracies, 1)
    )


@pytest.mark.parametrize(
    ("accuracies", "first", "stays"),
    [
        ((0.5, 1.0, 1.0), "2", "2"),
        ((0.5, 1.0, 0.9, 1.0), "2", "4"),
        ((1.0, 1.0), "1", "1"),
        ((0.5, 1.0, 0.9), "2", None),
    ],
)
def test_smallest_length(accuracies: tuple[float, ...], first: str, stays: str | None) -> None:
    found = smallest_length(curve(*accuracies))
    assert found is not None
    assert found.first.sequence_length == first
    assert (found.stays.sequence_length if found.stays else None) == stays


def test_no_smallest_length_where_none_is_perfect() -> None:
    assert smallest_length(curve(0.9, 0.99)) is None
    assert smallest_length(()) is None


def test_boost_is_relative_and_undefined_from_nothing() -> None:
    assert boost(curve(0.5, 0.75)) == [(1, 0.0), (2, 50.0)]
    assert boost(curve(0.0, 0.75)) == [(1, None), (2, None)]
    assert boost(curve(0.5, 0.75)[1:]) == []


@pytest.mark.parametrize(
    ("accuracies", "budget", "length"),
    [
        ((0.5, 0.6, 0.7, 0.8), 0.25, "2"),
        ((0.5, 1.0, 1.0, 1.0), 9.0, "2"),
        ((0.5, 0.6), 0.05, "1"),  # K = 1 even over the budget
        ((0.5, 0.6, 1.0), 0.25, "2"),  # 100 % only beyond the budget
    ],
)
def test_largest_within_a_budget(accuracies: tuple[float, ...], budget: float, length: str) -> None:
    found = largest_within(curve(*accuracies), budget)
    assert found is not None
    assert found.sequence_length == length


def test_curves_leave_out_dynamic_and_failed_runs() -> None:
    runs = [
        make_run(length="2"),
        make_run(length="1"),
        make_run(length="dynamic"),
        replace(make_run(length="3"), status="failed"),
        make_run(length="1", compression=(50, 50)),
    ]
    lengths = [[run.sequence_length for run in found] for found in curves_of(runs).values()]
    assert sorted(lengths) == [["1"], ["1", "2"]]


def test_the_size_a_technique_works_at_is_no_technique_of_its_own() -> None:
    small, large = (
        replace(make_run(), technique_parameters=f'{{"resolution": {side}, "cell": 8}}')
        for side in (64, 128)
    )
    assert condition_of(small) == condition_of(large)
    other = replace(small, technique_parameters='{"resolution": 64, "cell": 16}')
    assert condition_of(other) != condition_of(small)


def test_data_is_the_query_picture_times_its_frames() -> None:
    run = replace(make_run(length="5"), query_bytes_mean=1000.0, mean_sequence_length=5.0)
    assert data_per_answer(run) == 5000.0
    assert math.isnan(data_per_answer(replace(run, query_bytes_mean=math.nan)))


def test_mean_bytes_counts_every_picture_of_both_drives_once() -> None:
    run = replace(
        make_run(),
        query_bytes_total=1000,
        reference_bytes_total=5000,
        n_queries=10,
        n_references=20,
    )
    assert mean_bytes(run) == 200.0
    assert mean_bytes(replace(run, query_bytes_total=-1)) == run.query_bytes_mean


def test_least_data_weighs_length_against_size() -> None:
    def at(compression: int, size: float, length: int) -> dict[object, tuple[RunRecord, ...]]:
        run = make_run(length=str(length), compression=(compression, compression))
        full = replace(run, accuracy=1.0, query_bytes_mean=size)
        return {condition_of(full): (full,)}

    found = least_data({**at(50, 900.0, 2), **at(90, 300.0, 5), **at(99, 100.0, 20)})  # type: ignore[dict-item]
    assert found is not None
    assert found[0].compression_query == 90
    assert least_data({}) is None


def test_per_compute_unit_of_the_slowest_is_its_precision() -> None:
    slow = replace(make_run(), encode_s=0.5, p_r100=0.8, mean_sequence_length=1.0)
    fast = replace(slow, encode_s=0.005)
    assert per_compute_unit(slow, [slow, fast]) == pytest.approx(0.8)
    assert per_compute_unit(fast, [slow, fast]) == pytest.approx(0.8 * math.log10(109))
    assert math.isnan(per_compute_unit(replace(slow, encode_s=math.nan), [slow]))
