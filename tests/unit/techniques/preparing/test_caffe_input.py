"""Preparation against small examples worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import DataMissingError, InputError
from retraverse.techniques.preparing.caffe_input import (
    IMAGENET_MEAN_BGR,
    equalised,
    find_mean,
    in_order,
    read_mean,
    smooth,
)
from retraverse.types import ImageArray


def halves(dark: int, light: int) -> ImageArray:
    """Return a grey picture, its left half dark, its right half light."""
    picture = np.full((40, 40, 3), dark, np.uint8)
    picture[:, 20:] = light
    return picture


def test_equalised_grey_has_a_flat_histogram() -> None:
    # Levels 60, 100, 160 in shares 1/2, 1/4, 1/4. OpenCV maps a level to the share of pixels up to
    # it, without those of the lowest level: 0, then (1/4) / (1/2), then 1, times 255.
    picture = np.full((4, 4, 3), 60, np.uint8)
    picture[2], picture[3] = 100, 160
    expected = np.repeat([0, 0, 128, 255], 4).reshape(4, 4)
    np.testing.assert_allclose(equalised(picture), np.dstack([expected] * 3), atol=1)


def test_equalising_leaves_the_hue() -> None:
    picture = halves(60, 120)
    picture[..., 0] += 40
    red, green, blue = np.moveaxis(equalised(picture).astype(int), 2, 0)
    assert (red[:, 20:] >= green[:, 20:]).all()
    assert np.abs(green - blue).max() <= 1


def test_smooth_is_bilinear_and_not_rounded() -> None:
    # Two pixels to four: centres at -1/4, 1/4, 3/4, 5/4 of the way from the first to the second.
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[:, 1] = 10
    np.testing.assert_allclose(smooth(picture, 4)[0, :, 0], [0, 2.5, 7.5, 10])


def test_channels_in_order() -> None:
    picture = np.array([[[1, 2, 3]]], np.float32)
    assert in_order(picture, "rgb").tolist() == [[[1, 2, 3]]]
    assert in_order(picture, "bgr").tolist() == [[[3, 2, 1]]]


def test_a_mean_image_is_resized_and_has_blue_first(tmp_path: Path) -> None:
    mean = np.zeros((3, 2, 2))
    mean[:, 1] = [[10], [20], [30]]
    np.save(tmp_path / "mean.npy", mean)
    found = read_mean(tmp_path / "mean.npy", 4)
    assert found.shape == (4, 4, 3)
    np.testing.assert_allclose(found[:, 0], np.outer([0, 0.25, 0.75, 1], [10, 20, 30]))


def test_the_mean_colour_needs_no_file() -> None:
    assert find_mean("colour") is None
    assert read_mean(None, 3)[2, 2].tolist() == list(IMAGENET_MEAN_BGR)


def test_other_files_are_no_mean_image(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.zeros((5, 5)))
    with pytest.raises(InputError, match=r"expected one of shape \(3, height, width\)"):
        read_mean(tmp_path / "flat.npy", 3)
    with pytest.raises(DataMissingError):
        find_mean(str(tmp_path / "none.npy"))


def test_alexnet_conv3_sees_equalised_rgb_of_zero_to_one() -> None:
    seen = rt.technique("alexnet").prepare(halves(60, 100))  # type: ignore[attr-defined]
    assert seen.shape == (3, 227, 227)
    assert seen.dtype == np.float32
    np.testing.assert_allclose(seen[:, 100, 10], 0, atol=0.01)
    np.testing.assert_allclose(seen[:, 100, 220], 1, atol=0.01)


def test_alexnet_channels_are_red_first_unless_told() -> None:
    picture = halves(60, 120)
    picture[..., 0] += 40
    rgb, bgr = (
        rt.technique("alexnet", channels=order).prepare(picture)  # type: ignore[attr-defined]
        for order in ("rgb", "bgr")
    )
    np.testing.assert_array_equal(rgb[::-1], bgr)
    assert (rgb[0] >= rgb[2]).all()
    assert rgb[0].sum() > rgb[2].sum()


@pytest.mark.parametrize("name", ["alexnet", "amosnet", "hybridnet"])
def test_trained_preparation_is_blue_first_less_the_mean(name: str) -> None:
    settings = {"layer": "fc6"} if name == "alexnet" else {"mean": "colour"}
    picture = np.full((50, 60, 3), (200, 100, 50), np.uint8)
    seen = rt.technique(name, **settings).prepare(picture)  # type: ignore[attr-defined]
    assert seen.shape == (3, 227, 227)
    np.testing.assert_allclose(seen[:, 5, 7], [50 - 104, 100 - 117, 200 - 123])


def test_hybridnet_subtracts_the_mean_image_pixel_by_pixel(tmp_path: Path) -> None:
    mean = np.random.default_rng(0).uniform(0, 255, (3, 227, 227)).astype(np.float32)
    np.save(tmp_path / "mean.npy", mean)
    technique = rt.technique("hybridnet", mean=str(tmp_path / "mean.npy"))
    seen = technique.prepare(np.zeros((30, 30, 3), np.uint8))  # type: ignore[attr-defined]
    np.testing.assert_allclose(seen, -mean)


def test_regionvlad_subtracts_the_mean_images_colour(tmp_path: Path) -> None:
    mean = np.random.default_rng(0).uniform(0, 255, (3, 227, 227)).astype(np.float32)
    np.save(tmp_path / "mean.npy", mean)
    technique = rt.technique("regionvlad", mean=str(tmp_path / "mean.npy"), channels="bgr")
    seen = technique.prepare(np.zeros((30, 30, 3), np.uint8))  # type: ignore[attr-defined]
    np.testing.assert_allclose(seen[:, 0, 0], -mean.mean(axis=(1, 2)), rtol=1e-5)
    assert np.ptp(seen, axis=(1, 2)).max() == 0


def test_calc_sees_small_equalised_grey() -> None:
    seen = rt.technique("calc").prepare(halves(60, 100))  # type: ignore[attr-defined]
    assert seen.shape == (1, 120, 160)
    np.testing.assert_allclose(seen[0, 60, [10, 150]], [0, 1], atol=0.01)


def test_netvlad_sees_rgb_of_zero_to_255() -> None:
    picture = np.full((50, 60, 3), (200, 100, 50), np.uint8)
    seen = rt.technique("netvlad").prepare(picture)  # type: ignore[attr-defined]
    assert seen.shape == (3, 480, 640)
    assert seen[:, 5, 7].tolist() == [200, 100, 50]


def test_mobilenet_netvlad_sees_bgr_of_about_one() -> None:
    picture = np.full((50, 60, 3), (255, 128, 0), np.uint8)
    seen = rt.technique("mobilenetv2_netvlad").prepare(picture)  # type: ignore[attr-defined]
    assert seen.shape == (3, 480, 640)
    np.testing.assert_allclose(seen[:, 5, 7], [-256 / 255, 0, 254 / 255], rtol=1e-6)


@pytest.mark.parametrize("name", ["binarynet", "floppynet", "shallownet"])
def test_binary_networks_see_rgb_of_zero_to_one(name: str) -> None:
    picture = np.full((50, 60, 3), (255, 51, 0), np.uint8)
    seen = rt.technique(name).prepare(picture)  # type: ignore[attr-defined]
    assert seen.shape == (3, 227, 227)
    np.testing.assert_allclose(seen[:, 5, 7], [1, 0.2, 0], rtol=1e-6)
