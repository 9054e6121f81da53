"""Our metrics against scikit-learn's and SciPy's where the definitions coincide, and slow loops."""

import numpy as np
import pytest
from scipy.stats import binom
from sklearn import metrics as sklearn_metrics

from retraverse.metrics import (
    area_under_curve,
    average_precision,
    bootstrap_interval,
    cell_precision_recall_curve,
    precision_recall_curve,
    recall_at,
    recall_at_full_precision,
    true_match_rank,
)
from retraverse.types import BoolArray, FloatArray

SEEDS = range(12)
"""Shown in the name of each test."""


def best_matches(seed: int) -> tuple[BoolArray, FloatArray]:
    """Correctness that goes with the score, and scores with ties (rounded) for odd seeds."""
    random = np.random.default_rng(seed)
    score = random.random(200).astype(np.float32)
    correct = random.random(200) < score
    return correct, np.round(score, 1) if seed % 2 else score


def matrix(seed: int) -> tuple[FloatArray, BoolArray]:
    random = np.random.default_rng(seed)
    true_cells = random.random((30, 40)) < 0.05
    similarity = (random.random((30, 40)) + 0.5 * true_cells).astype(np.float32)
    return np.round(similarity, 2) if seed % 2 else similarity, true_cells


@pytest.mark.parametrize("seed", SEEDS)
def test_thesis_curve_is_scikit_learns(seed: int) -> None:
    correct, score = best_matches(seed)
    precision, recall, threshold = sklearn_metrics.precision_recall_curve(correct, score)
    curve = precision_recall_curve(correct, score)
    np.testing.assert_allclose(curve.precision, precision[::-1], rtol=1e-12)
    np.testing.assert_allclose(curve.recall, recall[::-1], rtol=1e-12)
    np.testing.assert_array_equal(curve.threshold[1:], threshold[::-1])
    assert area_under_curve(curve) == pytest.approx(sklearn_metrics.auc(recall, precision))
    expected = sklearn_metrics.average_precision_score(correct, score)
    assert average_precision(curve) == pytest.approx(expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_thinned_curve_over_cells_has_the_area_of_the_full_one(seed: int) -> None:
    similarity, true_cells = matrix(seed)
    flat = true_cells.ravel(), similarity.ravel()
    precision, recall, _ = sklearn_metrics.precision_recall_curve(*flat)
    curve = cell_precision_recall_curve(similarity, true_cells)
    assert len(curve.recall) <= 2 * true_cells.sum() + 2
    assert area_under_curve(curve) == pytest.approx(sklearn_metrics.auc(recall, precision))
    expected = sklearn_metrics.average_precision_score(*flat)
    assert average_precision(curve) == pytest.approx(expected)
    assert recall_at_full_precision(curve) == pytest.approx(recall[precision == 1].max())
    full = {(round(r, 12), round(p, 12)) for r, p in zip(recall, precision, strict=True)}
    ours = zip(curve.recall, curve.precision, strict=True)
    assert {(round(r, 12), round(p, 12)) for r, p in ours} <= full


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("n_thresholds", [2, 7, 100])
def test_grid_of_thresholds_is_the_obvious_loop(seed: int, n_thresholds: int) -> None:
    similarity, true_cells = matrix(seed)
    scores = similarity.astype(float)
    recall, precision = [0.0], [1.0]
    for threshold in np.linspace(scores.max(), scores.min(), n_thresholds):
        retrieved = scores >= threshold
        recall.append((retrieved & true_cells).sum() / true_cells.sum())
        precision.append((retrieved & true_cells).sum() / retrieved.sum())
    curve = cell_precision_recall_curve(similarity, true_cells, n_thresholds=n_thresholds)
    np.testing.assert_allclose(curve.recall, recall, rtol=1e-12)
    np.testing.assert_allclose(curve.precision, precision, rtol=1e-12)
    flat = precision_recall_curve(true_cells.ravel(), similarity.ravel(), n_thresholds=n_thresholds)
    np.testing.assert_allclose(flat.recall, recall, rtol=1e-12)
    np.testing.assert_allclose(flat.precision, precision, rtol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_rank_is_that_of_a_stable_sort(seed: int) -> None:
    similarity, true_cells = matrix(seed)
    order = np.argsort(-similarity, axis=1, kind="stable")
    rank = true_match_rank(similarity, true_cells)
    for query, candidates in enumerate(order):
        hits = np.flatnonzero(true_cells[query, candidates])
        assert rank[query] == (hits[0] + 1 if hits.size else -1)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("n", [1, 2, 5, 10])
def test_recall_at_is_scikit_learns_top_k_accuracy(n: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    similarity = random.random((60, 20))
    label = random.integers(0, 20, 60)
    expected = sklearn_metrics.top_k_accuracy_score(label, similarity, k=n, labels=np.arange(20))
    true_cells = np.arange(20) == label[:, None]
    assert recall_at(similarity, true_cells, n=[n]).all_queries[n] == pytest.approx(expected)


@pytest.mark.parametrize(("n_correct", "n"), [(30, 100), (95, 100), (7, 12)])
def test_bootstrap_of_an_accuracy_is_the_binomial_distribution(n_correct: int, n: int) -> None:
    # A resample of n answers holds a binomial number of correct ones.
    interval = bootstrap_interval(np.arange(n) < n_correct, n_resamples=20_000, seed=1)
    low, high = binom.ppf([0.025, 0.975], n, n_correct / n) / n
    assert abs(interval.low - low) <= 1 / n + 1e-12
    assert abs(interval.high - high) <= 1 / n + 1e-12
