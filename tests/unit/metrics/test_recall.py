import math

import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.metrics import recall_at, true_match_rank

# Query 0: right at once; 1: third; 2: has no true match; 3: fourth and last.
SIMILARITY = np.array(
    [[0.9, 0.1, 0.2, 0.3], [0.5, 0.4, 0.9, 0.1], [0.1, 0.9, 0.2, 0.3], [4, 3, 2, 1]], np.float32
)
TRUE_CELLS = np.array([[1, 1, 0, 0], [0, 1, 0, 1], [0, 0, 0, 0], [0, 0, 0, 1]], bool)


def test_rank_of_the_best_true_match() -> None:
    assert true_match_rank(SIMILARITY, TRUE_CELLS).tolist() == [1, 3, -1, 4]


def test_both_denominators() -> None:
    recall = recall_at(SIMILARITY, TRUE_CELLS, n=(1, 3, 4))
    assert recall.all_queries == {1: 0.25, 3: 0.5, 4: 0.75}
    assert recall.with_match == {1: pytest.approx(1 / 3), 3: pytest.approx(2 / 3), 4: 1.0}
    assert (recall.n_queries, recall.n_with_match) == (4, 3)


def test_the_usual_lengths_as_far_as_the_map_goes() -> None:
    assert list(recall_at(SIMILARITY, TRUE_CELLS).all_queries) == [1]
    assert list(recall_at(np.zeros((1, 10)), np.ones((1, 10), bool)).with_match) == [1, 5, 10]


def test_of_equal_scores_the_earlier_reference_comes_first() -> None:
    constant = np.zeros((3, 3))
    assert true_match_rank(constant, np.eye(3, dtype=bool)).tolist() == [1, 2, 3]
    assert true_match_rank(constant, ~np.eye(3, dtype=bool)).tolist() == [2, 1, 1]


def test_scores_may_be_integers_or_minus_infinity() -> None:
    whole = np.array([[3, 7, 7]], np.uint8)
    assert true_match_rank(whole, np.array([[True, False, True]])).tolist() == [2]
    impossible = np.array([[-np.inf, 1, -np.inf]])
    assert true_match_rank(impossible, np.array([[False, False, True]])).tolist() == [3]


def test_block_borders_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("retraverse.metrics.checks.BLOCK_CELLS", 4)
    assert true_match_rank(SIMILARITY, TRUE_CELLS).tolist() == [1, 3, -1, 4]


def test_a_share_of_nothing_is_nan() -> None:
    recall = recall_at(SIMILARITY, np.zeros_like(TRUE_CELLS), n=[1])
    assert recall.all_queries[1] == 0
    assert math.isnan(recall.with_match[1])


def test_bad_input() -> None:
    for length in (0, 5):
        with pytest.raises(ConfigError, match=f"n: got {length}, expected 1 to 4"):
            recall_at(SIMILARITY, TRUE_CELLS, n=[length])
    with pytest.raises(ShapeError, match="true_cells"):
        recall_at(SIMILARITY, TRUE_CELLS[:2])
    with pytest.raises(InputError, match="query 0, reference 0 is NaN"):
        recall_at(SIMILARITY * np.nan, TRUE_CELLS)
