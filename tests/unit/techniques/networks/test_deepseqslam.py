"""DeepSeqSLAM's LSTM against its equations, and the windows it is fed."""

from typing import Any

import numpy as np
import pytest
import torch
from tests.unit.techniques.seeded_weights import state_of

from retraverse.errors import ConfigError, InputError
from retraverse.techniques.networks.deepseqslam import (
    DeepSeqSlamNet,
    PositionMode,
    window_positions,
    windows,
)


def small(position: PositionMode = "relative") -> DeepSeqSlamNet:
    return DeepSeqSlamNet(3, 4, 5, hidden=6, position=position)


def test_windows_are_consecutive_frames() -> None:
    assert windows(np.arange(5), 3).tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4]]
    assert windows(np.zeros((7, 2)), 7).shape == (1, 7, 2)


def test_relative_positions_are_the_way_since_the_windows_first_frame() -> None:
    # Steps of 2 in x: in mean steps 0, 1, 2; divided by K = 3.
    positions = np.array([[100.0, 7.0], [102.0, 7.0], [104.0, 7.0], [106.0, 7.0]])
    found = window_positions(positions, 3, "relative")
    np.testing.assert_allclose(found[:, :, 0], [[0, 1 / 3, 2 / 3]] * 2, rtol=1e-6)
    assert not found[:, :, 1].any()


def test_relative_positions_do_not_say_where_on_the_drive() -> None:
    random = np.random.default_rng(1)
    positions = random.uniform(0, 50, (9, 2))
    moved = window_positions(positions + np.array([300, -40]), 4, "relative")
    np.testing.assert_allclose(window_positions(positions, 4, "relative"), moved, atol=1e-5)


def test_absolute_positions_go_from_minus_to_plus_a_thousand() -> None:
    positions = np.array([[0.0, 3.0], [5.0, 3.0], [10.0, 3.0]])
    found = window_positions(positions, 1, "absolute")
    assert found[:, 0].tolist() == [[-1000, -1000], [0, -1000], [1000, -1000]]


def test_a_drive_that_stands_still_has_finite_positions() -> None:
    for mode in ("relative", "absolute"):
        assert np.isfinite(window_positions(np.ones((4, 2)), 2, mode)).all()


def test_scores_are_the_lstms_last_state_through_the_head() -> None:
    torch.manual_seed(2)
    network = small()
    seen, where = torch.randn(2, 5, 3), torch.randn(2, 5, 2)
    with torch.inference_mode():
        found = network(seen, where).numpy()
    weights = {name: value.numpy().astype(float) for name, value in network.state_dict().items()}

    def sigmoid(x: Any) -> Any:
        return 1 / (1 + np.exp(-x))

    for batch in range(2):
        state, memory = np.zeros(6), np.zeros(6)
        for step in range(5):
            x = np.concatenate([seen[batch, step].numpy(), where[batch, step].numpy()])
            gates = (
                weights["lstm.weight_ih_l0"] @ x + weights["lstm.bias_ih_l0"]
                + weights["lstm.weight_hh_l0"] @ state + weights["lstm.bias_hh_l0"]
            )  # fmt: skip
            enter, forget, new, leave = gates.reshape(4, 6)
            memory = sigmoid(forget) * memory + sigmoid(enter) * np.tanh(new)
            state = sigmoid(leave) * np.tanh(memory)
        expected = weights["head.weight"] @ state + weights["head.bias"]
        np.testing.assert_allclose(found[batch], expected, atol=1e-5)


@pytest.mark.parametrize("position", ["relative", "absolute"])
def test_the_state_is_all_it_needs(position: PositionMode) -> None:
    state = state_of(lambda: small(position))
    network = DeepSeqSlamNet.from_tensors(state)
    assert network.position_mode == position
    assert int(network.sequence_length) == 5
    assert network.n_frames == 4 + 5 - 1
    again = {name: value.numpy() for name, value in network.state_dict().items()}
    assert again.keys() == state.keys()
    for name, value in state.items():
        np.testing.assert_array_equal(again[name], value)


def test_other_states_are_refused() -> None:
    state = state_of(small)
    with pytest.raises(InputError, match=r"no 'head\.bias' among"):
        DeepSeqSlamNet.from_tensors({k: v for k, v in state.items() if k != "head.bias"})
    with pytest.raises(InputError, match=r"'lstm\.bias_ih_l0' has shape \(3,\), expected \(24,\)"):
        DeepSeqSlamNet.from_tensors({**state, "lstm.bias_ih_l0": np.zeros(3)})


def test_a_drive_shorter_than_the_sequence_is_said() -> None:
    with pytest.raises(ConfigError, match="a drive shorter than the sequence"):
        DeepSeqSlamNet(3, 0, 5)
