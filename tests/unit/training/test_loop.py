"""The loop: learns, is repeatable, goes on where it was, and says what is wrong."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tests.unit.training.tiny import QUICK, Line
from torch import Tensor

from retraverse.errors import ConfigError, InputError
from retraverse.training.loop import CHECKPOINT, LoopSettings, learning_rate_at, run_loop


def weights(result: Any) -> Any:
    return torch.cat([one.detach().flatten() for one in result.network.parameters()]).numpy()


class StoppedError(Exception):
    pass


def stopping_after(steps: int) -> Any:
    """Return a progress that stops a run as Ctrl-C would."""

    def progress(items: Any, *, total: int, label: str) -> Any:
        for done, item in enumerate(items):
            if done == steps:
                raise StoppedError
            yield item

    return progress


def test_learns_and_says_every_loss(tmp_path: Path) -> None:
    result = run_loop(
        Line(), replace(QUICK, steps=100, learning_rate=0.2, largest_gradient=100.0), tmp_path
    )
    assert len(result.losses) == 100
    assert result.losses[-1] < 0.02 < result.losses[0]
    assert weights(result)[:3] == pytest.approx([2, 2, 2], abs=0.1)


@pytest.mark.parametrize("averaging", [0.0, 0.9])
@pytest.mark.parametrize("stop", [1, 4, 6, 11])
def test_resumed_equals_uninterrupted(tmp_path: Path, averaging: float, stop: int) -> None:
    settings = replace(QUICK, averaging=averaging)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    whole.mkdir()
    parts.mkdir()
    expected = run_loop(Line(), settings, whole)
    with pytest.raises(StoppedError):
        run_loop(Line(), settings, parts, progress=stopping_after(stop))
    resumed = run_loop(Line(), settings, parts, resume=True)
    assert resumed.first_step == stop // 4 * 4
    assert resumed.losses == pytest.approx(expected.losses, rel=1e-6)
    np.testing.assert_allclose(weights(resumed), weights(expected), rtol=1e-6)


def test_another_seed_is_another_run(tmp_path: Path) -> None:
    losses: list[Any] = []
    for seed in (0, 0, 1):
        folder = tmp_path / str(len(losses))
        folder.mkdir()
        losses.append(run_loop(Line(), replace(QUICK, seed=seed), folder).losses)
    assert losses[0] == losses[1] != losses[2]


def test_a_finished_run_is_not_run_again(tmp_path: Path) -> None:
    first = run_loop(Line(), QUICK, tmp_path)
    again = run_loop(Line(), QUICK, tmp_path, resume=True)
    assert again.first_step == QUICK.steps
    assert again.losses == first.losses


def test_average_is_the_weighted_mean_of_all_weights(tmp_path: Path) -> None:
    class Watched(Line):
        def __init__(self) -> None:
            super().__init__()
            self.history: list[Any] = []

        def loss(self, batch: tuple[Tensor, Tensor]) -> Tensor:
            self.history.append(self.network.weight.detach().clone())
            return super().loss(batch)

    task = Watched()
    result = run_loop(task, replace(QUICK, steps=40, averaging=0.5), tmp_path)
    by_hand = task.history[0]
    for step, now in enumerate([*task.history[1:], task.network.weight.detach()]):
        kept = min(0.5, (step + 1) / (step + 10))
        by_hand = kept * by_hand + (1 - kept) * now
    averaged = dict(result.network.named_parameters())["weight"].detach()
    torch.testing.assert_close(averaged, by_hand, rtol=1e-5, atol=1e-6)


def test_checkpoint_of_another_training(tmp_path: Path) -> None:
    run_loop(Line(), QUICK, tmp_path)
    with pytest.raises(InputError, match="a training was begun here"):
        run_loop(Line(), QUICK, tmp_path)
    with pytest.raises(InputError, match=r"learning_rate was 0.05, now 0.1"):
        run_loop(Line(), replace(QUICK, learning_rate=0.1), tmp_path, resume=True)
    with pytest.raises(InputError, match=r"wanted was 2.0, now 3.0"):
        run_loop(Line(3.0), QUICK, tmp_path, resume=True)


@pytest.mark.parametrize("damage", ["empty", "cut", "text"])
def test_damaged_checkpoint(tmp_path: Path, damage: str) -> None:
    run_loop(Line(), QUICK, tmp_path)
    path = tmp_path / CHECKPOINT
    whole = path.read_bytes()
    path.write_bytes({"empty": b"", "cut": whole[: len(whole) // 2], "text": b"hello"}[damage])
    with pytest.raises(InputError, match="checkpoint"):
        run_loop(Line(), QUICK, tmp_path, resume=True)


def test_a_loss_that_is_no_number(tmp_path: Path) -> None:
    class Diverging(Line):
        def loss(self, batch: tuple[Tensor, Tensor]) -> Tensor:
            return super().loss(batch) * math.nan

    with pytest.raises(InputError, match=r"the loss is nan at step 1.*learning rate"):
        run_loop(Diverging(), QUICK, tmp_path)
    assert not (tmp_path / CHECKPOINT).exists()


def test_nothing_to_train(tmp_path: Path) -> None:
    task = Line()
    task.network.requires_grad_(False)
    with pytest.raises(ConfigError, match="frozen"):
        run_loop(task, QUICK, tmp_path)


def test_learning_rate_rises_then_falls_to_nothing() -> None:
    settings = LoopSettings(steps=100, warm_up=9, learning_rate=2.0)
    rates = [learning_rate_at(settings, step) for step in range(100)]
    assert rates[0] == pytest.approx(0.2)
    assert max(rates) == rates[9]
    assert rates[9] == pytest.approx(2 * 0.5 * (1 + math.cos(math.pi * 0.09)))
    assert rates[50] == pytest.approx(1.0)
    assert 0 < rates[99] < 0.001


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", 0), ("learning_rate", 0), ("learning_rate", math.nan), ("averaging", 1.0),
     ("threads", 0), ("seed", -1), ("checkpoint_every", 0), ("largest_gradient", 0)],
)  # fmt: skip
def test_settings_out_of_range(name: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=name):
        replace(QUICK, **{name: value})
