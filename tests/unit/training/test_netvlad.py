"""NetVLAD's clusters and whitening: k-means, sharpness, PCA, and a whole run with random VGG16."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file
from tests.unit.training.tiny import pictures, write_pictures

import retraverse as rt
from retraverse.errors import ConfigError, InputError
from retraverse.techniques.networks.vgg_netvlad import VggNetVlad
from retraverse.training.netvlad import (
    NetVladSettings,
    assignment_sharpness,
    first_centres,
    moved_centres,
    train_netvlad,
    whitening,
)

SIZE = {"width": 64, "height": 64}


def blobs(seed: int = 3) -> np.ndarray:
    """Return 4 tight groups of 20 points around corners."""
    print("seed", seed)
    corners = np.array([[0, 0], [0, 9], [9, 0], [9, 9]], np.float32).repeat(20, axis=0)
    return corners + np.random.default_rng(seed).normal(0, 0.1, corners.shape).astype(np.float32)


def test_clusters_are_found() -> None:
    points = blobs()
    centres = first_centres(points, 4, np.random.default_rng(0))
    errors = []
    for _ in range(5):
        centres, error = moved_centres(points, centres)
        errors.append(error)
    assert errors == sorted(errors, reverse=True)
    found = sorted(np.rint(centres).astype(int).tolist())
    assert found == [[0, 0], [0, 9], [9, 0], [9, 9]]


def test_a_centre_without_points_stays() -> None:
    points = np.array([[0, 0], [0, 2]], np.float32)
    moved, _ = moved_centres(points, np.array([[0, 1], [50, 50]], np.float32))
    assert moved.tolist() == [[0, 1], [50, 50]]


def test_too_few_different_points() -> None:
    with pytest.raises(InputError, match="got 1 different local features, expected at least 3"):
        first_centres(np.ones((9, 2), np.float32), 3, np.random.default_rng(0))


def test_sharpness_gives_the_nearest_a_hundred_times_the_share() -> None:
    # Squared distances 1 and 16: a gap of 15 for every point.
    points, centres = np.array([[1.0], [1.0]], np.float32), np.array([[0.0], [5.0]], np.float32)
    alpha = assignment_sharpness(points, centres)
    shares = np.exp(-alpha * np.square(points - centres.T))
    assert shares[0, 0] / shares[0, 1] == pytest.approx(100, rel=1e-4)


def test_whitened_vectors_are_uncorrelated() -> None:
    random = np.random.default_rng(1)
    vectors = (random.standard_normal((30, 5)) @ random.standard_normal((5, 40))).astype(np.float32)
    matrix, shift = whitening(vectors, 100)
    assert matrix.shape == (5, 40)
    white = vectors @ matrix.T + shift
    np.testing.assert_allclose(white.mean(axis=0), 0, atol=1e-3)
    np.testing.assert_allclose(white.T @ white / 30, np.eye(5), atol=1e-3)
    assert whitening(vectors, 2)[0].shape == (2, 40)


def test_a_drive_gives_weights_of_the_technique(tmp_path: Path) -> None:
    torch.manual_seed(0)
    vgg = VggNetVlad(32768)
    start = tmp_path / "vgg.safetensors"
    save_file({name: value.numpy() for name, value in vgg.state_dict().items()}, start)
    drive = write_pictures(tmp_path / "drive", pictures(6, 5, 64, 64))
    settings = NetVladSettings(per_picture=40, iterations=2)
    parameters: dict[str, object] = {"weights": str(start), **SIZE}
    outcome = train_netvlad(drive, tmp_path / "out", settings, parameters=parameters)
    assert outcome.figures["dimension"] == 4
    tuned = rt.technique("netvlad", weights=str(outcome.weights), dimension=4, batch=1, **SIZE)
    scores = rt.similarity(rt.open_traverse(drive), rt.build_map(rt.open_traverse(drive), tuned))
    # Whitened vectors of the drive's own N pictures: all pairs equally far apart, -1 / (N - 1).
    expected = np.where(np.eye(5) > 0, 1, -1 / 4)
    np.testing.assert_allclose(scores, expected, atol=0.02)
    with pytest.raises(InputError, match="a training was begun here"):
        train_netvlad(drive, tmp_path / "out", settings, parameters=parameters)
    again = train_netvlad(drive, tmp_path / "out", settings, parameters=parameters, resume=True)
    assert again.weights.read_bytes() == outcome.weights.read_bytes()


def test_settings_out_of_range() -> None:
    with pytest.raises(ConfigError, match="iterations"):
        NetVladSettings(iterations=0)
