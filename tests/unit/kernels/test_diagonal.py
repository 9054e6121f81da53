"""Sequence scores: windows whose answer is known, ties, exactness, wrong input."""

import tracemalloc
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from retraverse.errors import InputError, ShapeError
from retraverse.kernels import (
    DiagonalSums,
    best_diagonals,
    best_diagonals_variable,
    diagonal,
    diagonal_scores,
)
from retraverse.kernels.backend import native

matrices = st.tuples(st.integers(1, 12), st.integers(1, 12)).flatmap(
    lambda shape: arrays(np.float32, shape, elements=st.floats(-1, 1, width=32))
)


@pytest.fixture(params=["native", "numpy"])
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(diagonal, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def random_matrix(seed: int, *shape: int) -> Any:
    print("seed", seed)
    return np.random.default_rng(seed).random(shape, dtype=np.float32)


@pytest.mark.usefixtures("kernels_in_use")
class TestKnownAnswers:
    def test_scores_of_a_small_matrix_by_hand(self) -> None:
        similarity = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.float32)
        assert diagonal_scores(similarity, 2).tolist() == [[3, 4], [6, 7]]
        assert diagonal_scores(similarity, 3).tolist() == [[5]]
        assert diagonal_scores(similarity, 1).tolist() == similarity.tolist()

    @pytest.mark.parametrize("shift", [0, 7])
    def test_a_shifted_traverse_is_found_at_its_shift(self, shift: int) -> None:
        similarity = np.eye(20, 40, shift, dtype=np.float32)
        reference, score = best_diagonals(similarity, 5)
        assert reference.tolist() == list(range(shift, shift + 16))
        assert score.tolist() == [1.0] * 16
        assert (reference.dtype.name, score.dtype.name) == ("int64", "float32")

    @pytest.mark.parametrize("sequence_length", [1, 2, 3, 19, 150])
    def test_equal_windows_tie_and_the_lowest_reference_wins(self, sequence_length: int) -> None:
        # 0.1 has no exact float32 or float64: plain running sums would drift apart
        similarity = np.full((1500, 160), 0.1, np.float32)
        reference, score = best_diagonals(similarity, sequence_length)
        assert not reference.any()
        assert set(score.tolist()) == {float(np.float32(0.1))}
        reference, score = DiagonalSums(similarity).best(sequence_length)
        assert not reference.any()
        assert set(score.tolist()) == {float(np.float32(0.1))}

    def test_a_place_visited_twice_gives_the_first_visit(self) -> None:
        once = random_matrix(1, 400, 90)
        twice = np.hstack([once, once, once])
        for sequence_length in (1, 4, 33):
            reference = best_diagonals(twice, sequence_length).reference
            scores = diagonal_scores(twice, sequence_length)
            assert (reference == scores.argmax(axis=1)).all()
            inner = scores[:, : 90 - sequence_length + 1]
            np.testing.assert_array_equal(scores[:, 90 : 90 + inner.shape[1]], inner)

    def test_each_window_may_have_its_own_length(self) -> None:
        similarity = random_matrix(2, 30, 25)
        lengths = np.random.default_rng(2).integers(1, 7, 24)
        reference, score = best_diagonals_variable(similarity, lengths)
        for query, length in enumerate(lengths.tolist()):
            row = diagonal_scores(similarity, length)[query]
            assert (reference[query], score[query]) == (row.argmax(), row.max())

    def test_lengths_may_be_a_list_and_may_be_empty(self) -> None:
        similarity = random_matrix(3, 5, 5)
        assert best_diagonals_variable(similarity, [2, 3, 3]).reference.shape == (3,)
        assert best_diagonals_variable(similarity, []).score.shape == (0,)

    def test_one_long_side(self) -> None:
        wide, tall = random_matrix(4, 3, 50), random_matrix(5, 50, 3)
        assert diagonal_scores(wide, 3).shape == (1, 48)
        assert diagonal_scores(tall, 3).shape == (48, 1)
        assert not best_diagonals(tall, 3).reference.any()

    @pytest.mark.parametrize("scale", [1e-40, 1e-6, 1.0, 255.0, 3e38])
    def test_any_scale_of_scores(self, scale: float) -> None:
        similarity = (random_matrix(6, 40, 40) - np.float32(0.5)) * np.float32(scale)
        expected = [
            [similarity[i : i + 7, j : j + 7].astype(np.float64).trace() / 7 for j in range(34)]
            for i in range(34)
        ]
        tolerance = max(scale * 1e-6, 1e-45)
        np.testing.assert_allclose(diagonal_scores(similarity, 7), expected, atol=tolerance)

    def test_views_and_wider_types_are_taken(self) -> None:
        similarity = random_matrix(7, 20, 30)
        expected = diagonal_scores(similarity, 4)
        np.testing.assert_array_equal(diagonal_scores(similarity.astype(np.float64), 4), expected)
        np.testing.assert_array_equal(diagonal_scores(np.asfortranarray(similarity), 4), expected)

    def test_the_scores_are_not_stored(self) -> None:
        similarity = random_matrix(12, 600, 500)
        tracemalloc.start()
        best_diagonals(similarity, 4)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < similarity.nbytes / 8

    def test_the_matrix_is_left_as_it_was(self) -> None:
        similarity = random_matrix(8, 20, 30)
        before = similarity.copy()
        best_diagonals(similarity, 4)
        DiagonalSums(similarity).best(4)
        np.testing.assert_array_equal(similarity, before)


@pytest.mark.usefixtures("kernels_in_use")
class TestWrongInput:
    @pytest.mark.parametrize("sequence_length", [-1, 0, 4, 6, 1.5])
    def test_a_length_that_does_not_fit(self, sequence_length: Any) -> None:
        similarity = random_matrix(9, 5, 3)
        message = (
            f"sequence length is {sequence_length}; expected a whole number from 1 to 3,"
            " for 5 query and 3 reference frames"
        )
        for function in (diagonal_scores, best_diagonals):
            with pytest.raises(InputError, match=message):
                function(similarity, sequence_length)
        with pytest.raises(InputError, match=message):
            DiagonalSums(similarity).scores(sequence_length)

    @pytest.mark.parametrize("shape", [(0, 5), (5, 0), (0, 0)])
    def test_no_frames(self, shape: tuple[int, int]) -> None:
        with pytest.raises(InputError, match="expected a whole number from 1 to 0"):
            best_diagonals(np.zeros(shape, np.float32), 1)

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_the_first_score_that_is_not_finite_is_named(self, bad: float) -> None:
        similarity = random_matrix(10, 6, 8)
        similarity[4, 1] = similarity[3, 5] = bad
        for function in (diagonal_scores, best_diagonals):
            with pytest.raises(InputError, match=rf"similarity\[3, 5\] is {bad}; expected finite"):
                function(similarity, 2)
        with pytest.raises(InputError, match=r"similarity\[3, 5\]"):
            DiagonalSums(similarity)

    def test_a_wider_score_that_float32_cannot_hold(self) -> None:
        with pytest.raises(InputError, match=r"similarity\[0, 1\] is inf"):
            best_diagonals(np.array([[1.0, 1e300]]), 1)

    def test_one_axis(self) -> None:
        with pytest.raises(ShapeError, match=r"expected \(queries, references\)"):
            best_diagonals(np.zeros(4, np.float32), 1)

    @pytest.mark.parametrize(
        ("lengths", "message"),
        [
            ([1, 1, 4, 1], "window at query 2 has length 4; expected 1 to 3"),
            ([0], "window at query 0 has length 0"),
            ([5, 5], "window at query 0 has length 5; expected 1 to 4"),
            ([1] * 6, "window at query 5 has length 1; expected 1 to 0"),
            ([1.5], "expected integers"),
            ([[1]], "expected integers"),
        ],
    )
    def test_a_window_that_does_not_fit(self, lengths: Any, message: str) -> None:
        with pytest.raises(InputError, match=message):
            best_diagonals_variable(random_matrix(11, 5, 4), lengths)


def outcomes(similarity: Any) -> list[Any]:
    """Everything every function says about a matrix, as bytes."""
    sums = DiagonalSums(similarity)
    found: list[Any] = [sums.sums]
    for length in range(1, min(similarity.shape) + 1):
        found += [diagonal_scores(similarity, length), sums.scores(length)]
        found += [*best_diagonals(similarity, length), *sums.best(length)]
    room = np.minimum(len(similarity) - np.arange(len(similarity)), similarity.shape[1])
    found += sums.best_variable(room)
    return [array.tobytes() for array in found]


class TestProperties:
    @given(matrices)
    def test_every_way_to_a_window_gives_the_same(self, similarity: Any) -> None:
        sums = DiagonalSums(similarity)
        for length in range(1, min(similarity.shape) + 1):
            scores = diagonal_scores(similarity, length)
            np.testing.assert_array_equal(sums.scores(length), scores)
            for reference, score in (best_diagonals(similarity, length), sums.best(length)):
                np.testing.assert_array_equal(reference, scores.argmax(axis=1))
                np.testing.assert_array_equal(score, scores.max(axis=1))

    @given(matrices)
    def test_a_score_lies_between_its_pairs(self, similarity: Any) -> None:
        for length in range(1, min(similarity.shape) + 1):
            scores = diagonal_scores(similarity, length)
            assert scores.min() >= similarity.min() - 1e-9
            assert scores.max() <= similarity.max() + 1e-9

    @given(matrices)
    def test_reversing_both_drives_reverses_the_scores(self, similarity: Any) -> None:
        for length in range(1, min(similarity.shape) + 1):
            there = diagonal_scores(similarity[::-1, ::-1], length)[::-1, ::-1]
            np.testing.assert_array_equal(there, diagonal_scores(similarity, length))

    @given(matrices)
    def test_exchanging_the_drives_transposes_the_scores(self, similarity: Any) -> None:
        for length in range(1, min(similarity.shape) + 1):
            there = diagonal_scores(similarity.T, length).T
            np.testing.assert_array_equal(there, diagonal_scores(similarity, length))

    @pytest.mark.skipif(native() is None, reason="no compiled kernels here")
    @given(matrices)
    def test_both_twins_agree_to_the_last_bit(self, similarity: Any) -> None:
        compiled = outcomes(similarity)
        with mock.patch.object(diagonal, "native", return_value=None):
            assert outcomes(similarity) == compiled
