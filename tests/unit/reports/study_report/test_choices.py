"""The cheapest settings that are accurate enough, against runs whose answer is known."""

import math
from dataclasses import replace

import pytest
from tests.unit.reports.study_report.made_up import make_run

from retraverse.reports.study_report.choices import cheapest, choices_table, frame_seconds
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord


def setting(
    name: str, accuracy: float, n_bytes: float, encode_s: float, **others: object
) -> RunRecord:
    """Return a single-frame run of one accuracy and cost."""
    run = make_run("corridor", name, accuracy=accuracy)
    values = {"run_id": name, "accuracy": accuracy, "query_bytes_mean": n_bytes}
    return replace(run, **values, encode_s=encode_s, match_s=0.001, **others)  # type: ignore[arg-type]


RUNS = [
    setting("small", 0.91, 900.0, 0.030),
    setting("fast", 0.92, 4000.0, 0.002),
    setting("both", 0.96, 1500.0, 0.010),
    setting("weak", 0.50, 10.0, 0.0001),
]


def rows(records: list[RunRecord]) -> list[tuple[str, ...]]:
    """Return target, "cheapest in", technique of every row, or why there is none."""
    return [
        tuple(cell.text for cell in row.cells[1:4]) if not row.absent
        else (row.cells[1].text, row.absent)
        for row in choices_table(records).rows
    ]  # fmt: skip


def test_each_target_has_its_cheapest_settings() -> None:
    found = rows(RUNS)
    assert found[:3] == [
        ("90 %", "bytes", "small"),
        ("90 %", "time", "fast"),
        ("95 %", "bytes and time", "both"),
    ]
    target, reason = found[3]
    assert target == "100 %"
    assert reason.startswith("none; the most accurate is 96.0")
    assert "both, K = 1" in reason
    assert len(found) == 4


@pytest.mark.parametrize("target", [0.0, 0.5, 0.91, 0.95, 1.0])
@pytest.mark.parametrize("cost", [data_per_answer, frame_seconds])
def test_nothing_cheaper_is_as_accurate(target: float, cost: object) -> None:
    assert callable(cost)
    found = cheapest(RUNS, target, cost)
    enough = [run for run in RUNS if run.accuracy >= target]
    assert (found is None) == (not enough)
    if found is not None:
        assert found in enough
        assert cost(found) == min(map(cost, enough))


def test_of_equal_cost_the_more_accurate_is_taken_and_no_cost_is_never_cheap() -> None:
    tie = setting("tie", 0.99, 900.0, 0.030)
    unknown = setting("unknown", 1.0, math.nan, 0.001)
    found = cheapest([*RUNS, tie, unknown], 0.9, data_per_answer)
    assert found is not None
    assert found.technique == "tie"


def test_failed_runs_are_no_choice_and_few_candidates_are_marked() -> None:
    lost = setting("lost", 1.0, 1.0, 1e-6, status="failed", error="broken")
    assert rows([*RUNS, lost]) == rows(RUNS)
    (row,) = choices_table([setting("sure", 1.0, 50.0, 0.1, n_candidates=3)]).rows[:1]
    assert (row.cells[-1].text, row.cells[-1].note) == ("3", "few")


def test_nothing_measured_gives_an_empty_table() -> None:
    assert choices_table([]).rows == ()
