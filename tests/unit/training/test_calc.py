"""CALC's autoencoder: its HOG, its warps, its weights in the technique."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.unit.training.tiny import QUICK, pictures, write_pictures

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.training.calc import N_HOG, CalcSettings, hog_of, random_warp, train_calc


def test_hog_has_the_published_length_and_sees_edges() -> None:
    flat = np.full((120, 160), 90, np.uint8)
    assert hog_of(flat).shape == (N_HOG,)
    assert not hog_of(flat).any()
    # Two directions without sign: a slant to the right fills one, to the left the other.
    y, x = np.mgrid[:120, :160]
    sums = []
    for slanted in (x + y, x - y):
        stripes = np.where(slanted % 16 < 8, 60, 200).astype(np.uint8)
        sums.append(hog_of(stripes).reshape(-1, 2).sum(axis=0))
    assert sums[0].argmax() != sums[1].argmax()
    assert all(one.max() > 2 * one.min() for one in sums)


def test_warps_move_corners_by_no_more_than_they_may() -> None:
    height, width = 120, 160
    across = np.tile(np.linspace(0, 255, width).astype(np.uint8), (height, 1))
    random = np.random.default_rng(2)
    for _ in range(20):
        seen = random_warp(across, 0.15, random).astype(int)
        assert seen[:, 0].max() <= 255 * 0.15 + 3
        assert seen[:, -1].min() >= 255 * 0.85 - 3
    assert not np.array_equal(random_warp(across, 0.15, random), across)


def test_trained_weights_are_the_techniques(tmp_path: Path) -> None:
    write_pictures(tmp_path / "set", pictures(1))
    loop = replace(QUICK, steps=2, learning_rate=1e-3)
    settings = CalcSettings(pictures=2, hidden=16, loop=loop)
    outcome = train_calc(tmp_path / "set", tmp_path / "out", settings)
    technique = rt.technique("calc", weights=str(outcome.weights), batch=1)
    image = pictures(1)[0]
    description = technique.describe(image)["descriptor"]
    assert description.shape == (1064,)
    assert np.linalg.norm(description) == pytest.approx(1, abs=1e-5)
    before = torch.load(tmp_path / "out" / "checkpoint.pt", weights_only=True)["network"]
    assert len([name for name in before if name.startswith("encoder")]) == 6


def test_settings_out_of_range() -> None:
    for wrong in ({"warp": 0.6}, {"hidden": 0}, {"pictures": 0}):
        with pytest.raises(ConfigError, match=next(iter(wrong))):
            CalcSettings(**wrong)
