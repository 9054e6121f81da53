"""Path and trajectory kernels: both twins, wrong input; what they compute is in tests/oracle."""

from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from retraverse import kernels
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.kernels import Motion, paths, trajectories
from retraverse.kernels.backend import native

MOTION = Motion(
    moves=np.array([1, 0, 2, -1]),
    weights=np.array([0.5, 0.2, 0.2, 0.05], np.float32),
    jump=0.02,
    leave=0.03,
    enter=0.1,
)
OFFSETS = np.array([[0, 0, 1], [0, 1, 2], [0, 1, 3], [-1, 0, 1]])


def outcomes(evidence: Any) -> list[Any]:
    """Everything the exact kernels say of a matrix, and then what the others do."""
    n = evidence.shape[1]
    found: list[Any] = []
    for is_open in (True, False):
        found += [*kernels.dtw_steps(evidence - evidence.min(), open=is_open)]
    state = np.zeros(n + 1, np.float32)
    found += [*kernels.viterbi(evidence, MOTION, state), state]
    nodes = np.zeros((2, n), np.float32)
    found += [
        *kernels.graph(evidence, MOTION.moves, nodes, hidden=0.5, surface=1.0, jump=2.0),
        nodes,
    ]
    if len(evidence) >= 3:
        found += kernels.best_trajectories(evidence, OFFSETS, radius=1, threads=2)
    belief = np.full(n + 1, 1 / (n + 1), np.float32)
    message = belief.copy()
    likelihood = np.exp(evidence)
    beliefs = [
        kernels.forward(likelihood, MOTION, belief), belief,
        kernels.backward(likelihood, MOTION, message), message,
    ]  # fmt: skip
    return [found, beliefs]


@pytest.mark.skipif(native() is None, reason="no compiled kernels here")
@given(
    seed=st.integers(0, 2**32 - 1),
    n_queries=st.integers(1, 12),
    n_references=st.integers(1, 40),
    digits=st.integers(0, 3),
)
def test_both_twins_agree(seed: int, n_queries: int, n_references: int, digits: int) -> None:
    random = np.random.default_rng(seed)
    # few digits make many ties
    evidence = np.round(random.normal(size=(n_queries, n_references)), digits).astype(np.float32)
    compiled = outcomes(evidence)
    with (
        mock.patch.object(paths, "native", return_value=None),
        mock.patch.object(trajectories, "native", return_value=None),
    ):
        twin = outcomes(evidence)
    for ours, theirs in zip(compiled[0], twin[0], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    for ours, theirs in zip(compiled[1], twin[1], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), cut=st.integers(1, 9))
def test_a_drive_in_parts_is_the_whole_drive(seed: int, cut: int) -> None:
    evidence = np.random.default_rng(seed).normal(size=(10, 15)).astype(np.float32)
    for once, twice in (
        [each(parts) for parts in ([evidence], [evidence[:cut], evidence[cut:]])]
        for each in (all_viterbi, all_graph, all_forward)
    ):
        for ours, theirs in zip(once, twice, strict=True):
            np.testing.assert_array_equal(ours, theirs)


def all_viterbi(parts: Any) -> list[Any]:
    state = np.zeros(16, np.float32)
    rows = [kernels.viterbi(np.ascontiguousarray(part), MOTION, state) for part in parts]
    return [*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)), state]


def all_graph(parts: Any) -> list[Any]:
    state = np.zeros((2, 15), np.float32)
    rows = [
        kernels.graph(
            np.ascontiguousarray(part), MOTION.moves, state, hidden=0.5, surface=1, jump=2
        )
        for part in parts
    ]
    return [*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)), state]


def all_forward(parts: Any) -> list[Any]:
    state = np.full(16, 1 / 16, np.float32)
    rows = [kernels.forward(np.ascontiguousarray(np.exp(part)), MOTION, state) for part in parts]
    return [np.concatenate(rows), state]


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_change_nothing(threads: int) -> None:
    rows = np.random.default_rng(4).normal(size=(300, 400)).astype(np.float32)
    once = kernels.best_trajectories(rows, OFFSETS, radius=5, threads=1)
    for ours, theirs in zip(
        once, kernels.best_trajectories(rows, OFFSETS, radius=5, threads=threads), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


MATRIX = np.zeros((4, 5), np.float32)
STATE = np.zeros(6, np.float32)


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda: kernels.dtw_steps(MATRIX[0], open=True), ShapeError, "contiguous float32"),
        (lambda: kernels.dtw_steps(MATRIX.T, open=True), ShapeError, "contiguous float32"),
        (lambda: kernels.dtw_steps(MATRIX[:0], open=True), ShapeError, "at least one row"),
        (lambda: kernels.viterbi(MATRIX.astype(float), MOTION, STATE), ShapeError, "float64"),
        (lambda: kernels.viterbi(MATRIX, MOTION, STATE[:5]), ShapeError, r"expected.*\(6,\)"),
        (lambda: kernels.forward(MATRIX, MOTION, STATE[:5]), ShapeError, r"expected.*\(6,\)"),
        (lambda: kernels.viterbi(MATRIX, moving(weights=[1, 0.5]), STATE), ShapeError, "one for"),
        (lambda: kernels.viterbi(MATRIX, moving(jump=0.5), STATE), ConfigError, "sum to 1.48"),
        (lambda: kernels.backward(MATRIX, moving(moves=range(70)), STATE), ShapeError, "up to 62"),
        (lambda: search(MATRIX, OFFSETS[:, :0]), InputError, "too few"),
        (lambda: search(MATRIX[:2], OFFSETS), InputError, "too few for trajectories of 3 rows"),
        (lambda: search(MATRIX, OFFSETS.astype(np.int32)), ShapeError, "offsets: got int32"),
        (lambda: search(MATRIX[0], OFFSETS), ShapeError, "differences: got float32 of shape"),
    ],
)  # fmt: skip
def test_wrong_input(call: Any, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        call()


def search(differences: Any, offsets: Any) -> Any:
    return kernels.best_trajectories(differences, np.ascontiguousarray(offsets), radius=1)


def moving(moves: Any = MOTION.moves, weights: Any = MOTION.weights, jump: float = 0.02) -> Motion:
    return Motion(
        np.array(moves, np.int64), np.array(weights, np.float32), jump, MOTION.leave, MOTION.enter
    )
