"""Windows one by one: verdicts, the true place nearest to an answer, and which to show."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.reports.records import make_record

from retraverse.datasets import from_positives
from retraverse.matching.matches import Matches
from retraverse.metrics import evaluate
from retraverse.reports.windows import Window, evenly, spread, windows_of
from retraverse.studies.comparison_record import ComparisonRecord

POSITIVES = [[0, 1], [2, 3, 4, 20, 21, 22], [], [], [39]]
ANSWERS = [1, 19, 7, -1, -1]


def five_windows() -> ComparisonRecord:
    record = make_record(5, 40, lengths=[1] * 5, tolerance=None)
    truth = from_positives([np.array(p, np.int64) for p in POSITIVES], 40)
    matches = Matches(
        np.arange(5), np.array(ANSWERS), record.matches.score, np.ones(5, np.int64), 5, 40
    )
    return replace(record, matches=matches, truth=truth, evaluation=evaluate(matches, truth))


def test_verdicts_and_true_places() -> None:
    windows = windows_of(five_windows())
    assert [window.verdict for window in windows] == [
        "correct",
        "wrong",
        "wrong",
        "refused",
        "refused",
    ]
    assert [window.is_right for window in windows] == [True, False, False, True, False]
    # Of two visits the one nearer to the answer, its middle; none where the place is not mapped.
    assert [window.true_reference for window in windows] == [1, 21, None, None, 39]
    assert [window.frames_off for window in windows] == [0, 2, None, None, None]


def test_without_truth_nothing_is_right_or_wrong() -> None:
    windows = windows_of(make_record(10, 12, tolerance=None))
    assert {window.verdict for window in windows} == {"unknown"}
    assert {window.is_right for window in windows} == {None}


def test_positives_past_the_end_of_the_map_are_no_places() -> None:
    record = make_record(5, 40, lengths=[1] * 5, tolerance=None)
    truth = from_positives([np.array([100], np.int64)] * 5)
    windows = windows_of(replace(record, truth=truth))
    assert {window.true_reference for window in windows} == {None}


def window(query: int) -> Window:
    return Window(query, query, 0.5, 1, 0.1, "unknown", None, None, None)


def test_spread_keeps_order_and_distance() -> None:
    ordered = [window(query) for query in (10, 11, 12, 30, 9, 20)]
    assert [w.query for w in spread(ordered, 3, apart=5)] == [10, 30, 20]
    assert [w.query for w in spread(ordered, 2, apart=1)] == [10, 11]
    assert spread([], 3, apart=5) == []


@pytest.mark.parametrize(
    ("n", "queries"), [(0, []), (1, [0]), (2, [0, 9]), (4, [0, 3, 6, 9]), (99, list(range(10)))]
)
def test_evenly(n: int, queries: list[int]) -> None:
    assert [w.query for w in evenly([window(q) for q in range(10)], n)] == queries
