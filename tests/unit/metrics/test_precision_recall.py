"""Curves worked out by hand."""

import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.metrics import (
    area_under_curve,
    average_precision,
    cell_precision_recall_curve,
    extended_precision,
    precision_at_full_recall,
    precision_recall_curve,
    recall_at_full_precision,
)

RIGHT_WRONG_RIGHT = ([True, False, True], [0.9, 0.8, 0.7])


def test_thesis_curve_and_all_its_numbers() -> None:
    curve = precision_recall_curve(*RIGHT_WRONG_RIGHT)
    assert curve.definition == "thesis"
    assert curve.n_positives == 2
    np.testing.assert_allclose(curve.recall, [0, 0.5, 0.5, 1])
    np.testing.assert_allclose(curve.precision, [1, 1, 0.5, 2 / 3])
    np.testing.assert_array_equal(curve.threshold, [np.inf, 0.9, 0.8, 0.7])
    assert area_under_curve(curve) == pytest.approx(0.5 * 1 + 0.5 * (1 / 2 + 2 / 3) / 2)
    assert average_precision(curve) == pytest.approx(0.5 * 1 + 0.5 * 2 / 3)
    assert precision_at_full_recall(curve) == pytest.approx(2 / 3)
    assert recall_at_full_precision(curve) == 0.5
    assert extended_precision(curve) == pytest.approx((1 + 0.5) / 2)


def test_single_curve_counts_queries_that_have_a_match() -> None:
    curve = precision_recall_curve(*RIGHT_WRONG_RIGHT, n_positives=4)
    assert curve.definition == "single"
    np.testing.assert_allclose(curve.recall, [0, 0.25, 0.25, 0.5])
    assert area_under_curve(curve) == pytest.approx(0.25 + 0.25 * (1 / 2 + 2 / 3) / 2)
    assert recall_at_full_precision(curve) == 0.25
    assert precision_at_full_recall(curve) == 0, "recall never reaches 1"


def test_wrong_lowest_scores_lower_accuracy_but_not_precision_at_full_recall() -> None:
    curve = precision_recall_curve([True, True, False], [3, 2, 1])
    assert precision_at_full_recall(curve) == 1
    assert curve.precision[-1] == pytest.approx(2 / 3)


def test_equal_scores_enter_as_one_point_whatever_their_order() -> None:
    for correct in ([True, False], [False, True]):
        curve = precision_recall_curve(correct, [0.4, 0.4])
        np.testing.assert_array_equal(curve.recall, [0, 1])
        np.testing.assert_array_equal(curve.precision, [1, 0.5])
        assert area_under_curve(curve) == 0.75
        assert average_precision(curve) == 0.5
        assert extended_precision(curve) == 0.25, "R_P100 counts as 0 when P_R0 < 1"


def test_highest_score_wrong() -> None:
    curve = precision_recall_curve([False, True], [2, 1])
    assert recall_at_full_precision(curve) == 0
    assert extended_precision(curve) == 0
    assert area_under_curve(curve) == pytest.approx(0.25), "from (0, 0) to (1, 1/2)"


@pytest.mark.parametrize("correct", [[], [False], [False, False, False]])
def test_nothing_correct_scores_nothing(correct: list[bool]) -> None:
    curve = precision_recall_curve(correct, np.arange(len(correct)))
    assert curve.recall.tolist() == [0.0] * (len(correct) + 1)
    assert curve.precision[0] == 1
    for number in (
        area_under_curve,
        average_precision,
        precision_at_full_recall,
        recall_at_full_precision,
        extended_precision,
    ):
        assert number(curve) == 0


def test_one_query_that_is_right_scores_everything() -> None:
    curve = precision_recall_curve([True], [-3.0])
    for number in (area_under_curve, precision_at_full_recall, extended_precision):
        assert number(curve) == 1


def test_grid_of_thresholds_loses_recall_at_full_precision() -> None:
    # The grid of two has the highest and the lowest score only: the second right match is lost.
    correct, score = [True, True, False], [1.0, 0.9, 0.0]
    assert recall_at_full_precision(precision_recall_curve(correct, score)) == 1
    curve = precision_recall_curve(correct, score, n_thresholds=2)
    np.testing.assert_array_equal(curve.threshold, [np.inf, 1, 0])
    np.testing.assert_allclose(curve.recall, [0, 0.5, 1])
    np.testing.assert_allclose(curve.precision, [1, 1, 2 / 3])
    assert recall_at_full_precision(curve) == 0.5


def test_grid_over_constant_scores_repeats_one_point() -> None:
    curve = precision_recall_curve([True, False], [5.0, 5.0], n_thresholds=4)
    assert curve.precision.tolist() == [1, 0.5, 0.5, 0.5, 0.5]
    assert area_under_curve(curve) == 0.75


SIMILARITY = np.array([[0.9, 0.5, 0.1], [0.8, 0.7, 0.2]], np.float32)
TRUE_CELLS = np.array([[1, 0, 0], [0, 1, 0]], bool)


def test_cell_curve() -> None:
    # By falling score: .9 right, .8 wrong, .7 right, then three wrong, the last of which stays.
    curve = cell_precision_recall_curve(SIMILARITY, TRUE_CELLS)
    assert curve.definition == "multi"
    assert curve.n_positives == 2
    np.testing.assert_allclose(curve.recall, [0, 0.5, 0.5, 1, 1])
    np.testing.assert_allclose(curve.precision, [1, 1, 1 / 2, 2 / 3, 1 / 3])
    np.testing.assert_allclose(curve.threshold, [np.inf, 0.9, 0.8, 0.7, 0.1], rtol=1e-6)
    assert precision_at_full_recall(curve) == pytest.approx(2 / 3)
    assert area_under_curve(curve) == pytest.approx(0.5 + 0.5 * (1 / 2 + 2 / 3) / 2)


def test_cell_curve_drops_only_thresholds_that_leave_recall_as_it_is() -> None:
    similarity = np.array([[9, 8, 7, 6, 5, 4, 3, 2, 1]], float)
    curve = cell_precision_recall_curve(similarity, similarity == 5)
    np.testing.assert_array_equal(curve.threshold, [np.inf, 6, 5, 1])
    np.testing.assert_allclose(curve.precision, [1, 0, 1 / 5, 1 / 9])


def test_cell_curve_on_a_grid() -> None:
    curve = cell_precision_recall_curve(SIMILARITY.astype(float), TRUE_CELLS, n_thresholds=3)
    np.testing.assert_allclose(curve.threshold, [np.inf, 0.9, 0.5, 0.1], rtol=1e-6)
    np.testing.assert_allclose(curve.recall, [0, 0.5, 1, 1])
    np.testing.assert_allclose(curve.precision, [1, 1, 2 / 4, 2 / 6])


def test_cell_curve_without_true_cells_or_without_cells() -> None:
    none_true = cell_precision_recall_curve(SIMILARITY, np.zeros_like(TRUE_CELLS))
    assert area_under_curve(none_true) == precision_at_full_recall(none_true) == 0
    for n_thresholds in (None, 5):
        empty = cell_precision_recall_curve(
            np.zeros((0, 3)), np.zeros((0, 3), bool), n_thresholds=n_thresholds
        )
        assert empty.recall.tolist() == [0]
        assert area_under_curve(empty) == 0


@pytest.mark.parametrize("seed", range(5))
def test_block_borders_do_not_show(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    random = np.random.default_rng(seed)
    similarity = random.integers(0, 9, (7, 5)).astype(np.float32)
    true_cells = random.random((7, 5)) < 0.3
    whole = cell_precision_recall_curve(similarity, true_cells)
    monkeypatch.setattr("retraverse.metrics.checks.BLOCK_CELLS", 10)
    in_blocks = cell_precision_recall_curve(similarity, true_cells)
    np.testing.assert_array_equal(whole.threshold, in_blocks.threshold)
    np.testing.assert_array_equal(whole.precision, in_blocks.precision)


@pytest.mark.parametrize(
    ("correct", "score", "options", "error", "words"),
    [
        ([True, False], [1.0], {}, ShapeError, r"score: got shape \(1,\), expected \(2,\)"),
        ([[True]], [[1.0]], {}, ShapeError, "correct: got bool of shape"),
        ([0.5, 1.0], [1.0, 2.0], {}, ShapeError, "correct: got float64"),
        ([True, False], [1.0, np.nan], {}, InputError, "1 of 2 are NaN, the first at 1"),
        ([True, True], [1, 2], {"n_positives": 1}, InputError, "2 best matches are correct"),
        ([True, True], [1, 2], {"n_thresholds": 1}, ConfigError, "n_thresholds: got 1"),
        ([True, True], [1, -np.inf], {"n_thresholds": 5}, InputError, "no even grid"),
    ],
)
def test_bad_input(
    correct: list[bool],
    score: list[float],
    options: dict[str, int],
    error: type[Exception],
    words: str,
) -> None:
    with pytest.raises(error, match=words):
        precision_recall_curve(correct, score, **options)


def test_bad_matrices() -> None:
    with pytest.raises(ShapeError, match="transposed"):
        cell_precision_recall_curve(SIMILARITY, TRUE_CELLS.T)
    with pytest.raises(ShapeError, match="true_cells: got int64"):
        cell_precision_recall_curve(SIMILARITY, TRUE_CELLS.astype(np.int64))
    with pytest.raises(ShapeError, match="two axes"):
        cell_precision_recall_curve(SIMILARITY[0], TRUE_CELLS[0])
    spoilt = SIMILARITY.copy()
    spoilt[1, 2] = np.nan
    with pytest.raises(InputError, match="query 1, reference 2 is NaN"):
        cell_precision_recall_curve(spoilt, TRUE_CELLS)
