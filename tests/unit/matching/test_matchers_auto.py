"""The matcher that picks: drives whose known part is shorter than what a speed is read from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import retraverse as rt


@pytest.mark.parametrize("n_known", [2, 5, 14, 19, 20, 21])
def test_a_short_known_part_in_a_long_drive(n_known: int) -> None:
    random = np.random.default_rng(0)
    scores = random.random((60, 50), np.float32) * np.float32(0.02)
    scores[20 + np.arange(n_known), 10 + np.arange(n_known)] += 5
    matches = rt.match_similarity(scores, sequence_length=4, matcher="auto")
    assert len(matches.frame_reference) == 60
    assert matches.notes


@given(seed=st.integers(0, 2**32 - 1), shape=st.tuples(st.integers(5, 70), st.integers(5, 70)))
def test_any_matrix_gets_an_answer_and_a_reason(seed: int, shape: tuple[int, int]) -> None:
    random = np.random.default_rng(seed)
    scores = random.random(shape, np.float32) ** np.float32(8)
    matches = rt.match_similarity(scores, sequence_length=3, matcher="auto")
    assert len(matches.frame_reference) == shape[0]
    assert any("auto" in note for note in matches.notes)
