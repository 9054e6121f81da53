from typing import Any

import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError
from retraverse.images import jpeg_parts as parts
from retraverse.images.jpeg import Encoder
from retraverse.types import ImageArray


def scene(height: int = 45, width: int = 61, seed: int = 5) -> ImageArray:
    noise = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    smooth = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.5), np.float32)
    smooth = (smooth - smooth.min()) * (200 / (smooth.max() - smooth.min())) + 25
    return np.asarray(smooth, np.uint8)


def step(picture: ImageArray, column: int) -> float:
    """Return the mean jump between a column and the one before it."""
    grey = picture.mean(axis=2) if picture.ndim == 3 else picture.astype(float)
    return float(np.abs(grey[:, column] - grey[:, column - 1]).mean())


def block_means(grey: ImageArray) -> np.ndarray:
    height, width = (side // 8 * 8 for side in grey.shape)
    cut = grey[:height, :width].astype(float)
    return np.asarray(cut.reshape(height // 8, 8, width // 8, 8).mean(axis=(1, 3)))


@pytest.mark.parametrize("c", [30, 80, 95])
def test_all_steps_together_are_jpeg_without_subsampling(c: int) -> None:
    ours = parts.quantise(scene(), c)
    real = parts.compress(scene(), c, Encoder(subsampling="4:4:4"))
    # libjpeg works in whole numbers and rounds colour before it transforms.
    assert np.abs(ours.astype(int) - real).mean() < 1.5
    grey = scene()[..., 1].copy()
    difference = parts.quantise(grey, c).astype(int) - parts.compress(grey, c)
    assert np.abs(difference).mean() < 0.5


def test_one_band_is_the_mean_of_each_block() -> None:
    grey = scene(48, 64)[..., 0].copy()
    means = parts.keep_bands(grey, 1)
    expected = np.kron(block_means(grey), np.ones((8, 8)))
    np.testing.assert_allclose(means, expected, atol=0.51)


def test_bands_add_detail_until_all_is_there() -> None:
    for keep in (parts.keep_bands, parts.keep_bands_smoothly):
        errors = [np.abs(keep(scene(), n).astype(int) - scene()).mean() for n in (1, 2, 4, 8, 15)]
        assert errors == sorted(errors, reverse=True)
        assert errors[-1] < 0.5


def test_smooth_bands_have_no_grid() -> None:
    picture = scene(64, 64)
    blocky, smooth = parts.keep_bands(picture, 2), parts.keep_bands_smoothly(picture, 2)
    at_edges = [np.mean([step(one, c) for c in range(8, 64, 8)]) for one in (blocky, smooth)]
    inside = [np.mean([step(one, c) for c in range(4, 64, 8)]) for one in (blocky, smooth)]
    assert at_edges[0] > 1.5 * inside[0]
    assert at_edges[1] < 1.3 * inside[1]


def test_means_and_details_are_rounded_apart() -> None:
    grey = scene(48, 64)[..., 0].copy()
    means, details = (
        parts.quantise(grey, 97, means=True, details=False),
        parts.quantise(grey, 97, means=False, details=True),
    )
    # Only the mean of a block changes in one, everything but the mean in the other.
    change = means.astype(int) - grey
    assert all(np.ptp(change[8 * i : 8 * i + 8, :8]) <= 1 for i in range(6))
    np.testing.assert_allclose(block_means(details), block_means(grey), atol=0.6)
    assert np.abs(details.astype(int) - grey).mean() > 3


def test_deblocking_takes_the_grid_away_and_grid_only_adds_it() -> None:
    picture = scene(64, 64)
    blocky, smooth = parts.compress(picture, 97), parts.deblock(picture, 97)
    added = parts.grid_only(picture, 97)
    edges = range(8, 64, 8)
    at_edges = {
        name: np.mean([step(one, c) for c in edges])
        for name, one in (("blocky", blocky), ("smooth", smooth), ("added", added))
    }
    clean = np.mean([step(picture, c) for c in edges])
    assert at_edges["smooth"] < 0.7 * at_edges["blocky"]
    assert at_edges["added"] > 1.2 * clean


def test_colour_parts_leave_luminance_alone() -> None:
    picture = scene()
    luma = np.array([0.299, 0.587, 0.114])
    for worse in (parts.subsample_colour(picture), parts.without_colour(picture)):
        # Clipping of extreme colours may move a few pixels.
        assert np.median(np.abs(worse @ luma - picture @ luma)) < 0.8
    assert np.ptp(parts.without_colour(picture).astype(int), axis=2).max() <= 1


def test_mixing_takes_luminance_and_colour_from_different_pictures() -> None:
    one, other = scene(seed=1), scene(seed=2)
    mixed = parts.mix_planes(one, other)
    luma = np.array([0.299, 0.587, 0.114])
    assert np.median(np.abs(mixed @ luma - one @ luma)) < 1.5
    np.testing.assert_allclose(parts.mix_planes(one, one).astype(int), one, atol=1)


@pytest.mark.parametrize(
    "change",
    [
        lambda picture: parts.compress(picture, 90),
        lambda picture: parts.keep_bands(picture, 3),
        lambda picture: parts.keep_bands_smoothly(picture, 3),
        lambda picture: parts.quantise(picture, 90),
        parts.subsample_colour,
        parts.without_colour,
        lambda picture: parts.mix_planes(picture, picture),
        lambda picture: parts.deblock(picture, 90),
        lambda picture: parts.grid_only(picture, 90),
    ],
)
@pytest.mark.parametrize("shape", [(8, 8), (1, 1), (7, 23, 3), (33, 16, 3)])
def test_every_part_keeps_the_shape_and_the_input(change: Any, shape: tuple[int, ...]) -> None:
    picture = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    before = picture.copy()
    worse = change(picture)
    assert worse.shape == shape
    assert worse.dtype == np.uint8
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize("n_bands", [0, 16])
def test_bands_out_of_range(n_bands: int) -> None:
    for keep in (parts.keep_bands, parts.keep_bands_smoothly):
        with pytest.raises(ConfigError, match=f"bands: got {n_bands}, expected 1 to 15"):
            keep(scene(), n_bands)
