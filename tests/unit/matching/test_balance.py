"""Balancing by definition, offline and frame by frame."""

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import InputError, ShapeError
from retraverse.matching import RunningBalance, balance
from retraverse.types import FloatArray


def drive(n_frames: int, hub: float, seed: int = 0) -> FloatArray:
    """Return the similarities of an aligned drive in which some references please everyone."""
    random = np.random.default_rng(seed)
    scores = random.normal(0, 0.2, (n_frames, n_frames)) + 0.8 * np.eye(n_frames)
    scores[:, ::7] += hub
    return scores.astype(np.float32)


def accuracy(scores: FloatArray) -> float:
    return float((scores.argmax(axis=1) == np.arange(len(scores))).mean())


def test_rows_then_columns_are_standardised() -> None:
    scores = drive(40, 0.5)
    rows = (scores - scores.mean(1, keepdims=True)) / scores.std(1, keepdims=True)
    expected = (rows - rows.mean(0)) / rows.std(0)
    np.testing.assert_allclose(balance(scores), expected, atol=1e-5)


def test_hubs_lose_their_advantage() -> None:
    scores = drive(80, 1.0)
    running = RunningBalance(80)
    online = np.stack([running.update(row) for row in scores])
    assert accuracy(scores) < 0.5
    assert accuracy(balance(scores)) > 0.9
    assert accuracy(online) > 0.8


def test_the_running_balance_is_its_formula() -> None:
    scores = drive(12, 0.5)
    rows = (scores - scores.mean(1, keepdims=True)) / scores.std(1, keepdims=True)
    running = RunningBalance(12)
    for seen in range(1, 13):
        got = running.update(scores[seen - 1])
        # Ten more frames of mean 0 and variance 1 before the first.
        mean = rows[:seen].sum(axis=0) / (seen + 10)
        square = ((rows[:seen] ** 2).sum(axis=0) + 10) / (seen + 10)
        expected = (rows[seen - 1] - mean) / np.sqrt(square - mean**2)
        np.testing.assert_allclose(got, expected, rtol=1e-4, atol=1e-5)


def test_on_a_long_drive_the_two_agree_at_the_end() -> None:
    scores = np.random.default_rng(3).random((3000, 5)).astype(np.float32)
    running = RunningBalance(5)
    for row in scores:
        last = running.update(row)
    np.testing.assert_allclose(last, balance(scores)[-1], atol=0.02)


def test_scale_does_not_matter() -> None:
    scores = drive(20, 0.5)
    np.testing.assert_allclose(balance(3 * scores + 5), balance(scores), atol=1e-4)


def test_constant_rows_and_columns_stay_finite() -> None:
    scores = np.ones((4, 6), np.float32)
    assert not balance(scores).any()
    assert not RunningBalance(6).update(scores[0]).any()


def test_balanced_scores_can_be_matched() -> None:
    matches = rt.match_similarity(balance(drive(30, 1.0)), sequence_length=3)
    assert (matches.reference == np.arange(28)).mean() > 0.9


@pytest.mark.parametrize(
    ("scores", "error"),
    [
        (np.ones((1, 4)), InputError),
        (np.ones(4), ShapeError),
        (np.ones((3, 0)), ShapeError),
        (np.full((2, 2), np.inf), ShapeError),
    ],
)
def test_bad_matrices(scores: FloatArray, error: type[Exception]) -> None:
    with pytest.raises(error):
        balance(scores)


@pytest.mark.parametrize("row", [np.ones(3), np.ones((1, 4)), np.full(4, np.nan)])
def test_bad_rows(row: FloatArray) -> None:
    with pytest.raises(ShapeError):
        RunningBalance(4).update(row)
