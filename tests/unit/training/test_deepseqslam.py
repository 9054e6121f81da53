"""DeepSeqSLAM's training: places are learned, weights fit the technique, short drives refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.training.tiny import QUICK, pictures, write_pictures

import retraverse as rt
from retraverse.errors import ConfigError, InputError
from retraverse.techniques.deepseqslam import frame_positions
from retraverse.training.deepseqslam import DeepSeqSettings, DeepSeqSlamTask, train_deepseqslam
from retraverse.training.loop import run_loop

SETTINGS = DeepSeqSettings(
    sequence_length=3, hidden=32, windows=32, noise=0.3, loop=replace(QUICK, learning_rate=0.01)
)


@pytest.mark.parametrize("position", ["relative", "absolute"])
def test_places_are_learned(tmp_path: Path, position: Any) -> None:
    descriptors = np.random.default_rng(3).standard_normal((12, 8)).astype(np.float32)
    settings = replace(SETTINGS, position=position, loop=replace(SETTINGS.loop, steps=80))
    task = DeepSeqSlamTask(descriptors, frame_positions(12), settings)
    losses = run_loop(task, settings.loop, tmp_path).losses
    assert losses[0] == pytest.approx(np.log(10), abs=0.3)
    assert np.mean(losses[-10:]) < 0.8 * losses[0]
    # Positions up to 1000 drown descriptors of size 1: as published, not as good.
    assert task.share_right() > (0.9 if position == "relative" else 0.2)


def test_weights_find_the_drive_again(tmp_path: Path) -> None:
    folder = write_pictures(tmp_path / "drive", pictures(4, 8))
    cnn = {"cnn": "sad(resolution=8)"}
    settings = replace(SETTINGS, loop=replace(SETTINGS.loop, steps=120))
    outcome = train_deepseqslam(folder, tmp_path / "out", settings, parameters=dict(cnn))
    assert outcome.figures["own windows named right"] > 0.8
    technique = rt.technique("deepseqslam", weights=str(outcome.weights), **cnn)
    drive = rt.open_traverse(folder)
    scores = rt.similarity(drive, rt.build_map(drive, technique))
    assert (scores[:6].argmax(axis=1) == np.arange(6)).mean() > 0.8


def test_a_drive_of_one_window() -> None:
    with pytest.raises(InputError, match="got a drive of 3 frames, expected at least 4"):
        DeepSeqSlamTask(np.zeros((3, 2)), frame_positions(3), SETTINGS)


def test_settings_out_of_range() -> None:
    for wrong in ({"sequence_length": 0}, {"noise": -1}, {"windows": 0}):
        with pytest.raises(ConfigError, match=next(iter(wrong))):
            DeepSeqSettings(**wrong)  # type: ignore[arg-type]
