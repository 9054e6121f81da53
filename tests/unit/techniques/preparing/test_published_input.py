"""Preparation as published: against PyTorch's own resizing, and by hand."""

import numpy as np
import pytest

from retraverse.techniques.preparing.published_input import (
    Filter,
    imagenet_normalised,
    resized_8_bit,
    resized_float,
)
from retraverse.types import ImageArray


def noise(height: int, width: int) -> ImageArray:
    return np.random.default_rng(2).integers(0, 256, (height, width, 3)).astype(np.uint8)


def test_normalised_by_hand() -> None:
    image = np.zeros((2, 3, 3), np.uint8)
    image[1, 2] = 255, 0, 128
    tensor = imagenet_normalised(image)
    assert tensor.shape == (3, 2, 3)
    assert tensor.dtype == np.float32
    np.testing.assert_allclose(
        tensor[:, 1, 2],
        [(1 - 0.485) / 0.229, -0.456 / 0.224, (128 / 255 - 0.406) / 0.225],
        rtol=1e-6,
    )


@pytest.mark.parametrize("how", ["bilinear", "bicubic"])
@pytest.mark.parametrize("size", [(64, 64), (20, 90)])
def test_float_resizing_is_pytorchs_with_antialiasing(how: Filter, size: tuple[int, int]) -> None:
    torch = pytest.importorskip("torch", reason="the extra 'learned' is not installed")
    image = noise(48, 71)
    planes = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32))
    theirs = torch.nn.functional.interpolate(planes, size, mode=how, antialias=True)
    ours = resized_float(image, *size, how)
    assert ours.dtype == np.float32
    np.testing.assert_allclose(ours.transpose(2, 0, 1), theirs[0].numpy(), atol=2e-3)


@pytest.mark.parametrize("how", ["bilinear", "bicubic"])
def test_8_bit_resizing_rounds_and_clips(how: Filter) -> None:
    calm = noise(48, 71) // 4 + 96  # Nothing to clip: only rounding, twice.
    eight, floats = resized_8_bit(calm, 30, 90, how), resized_float(calm, 30, 90, how)
    assert eight.dtype == np.uint8
    assert np.abs(eight - floats).max() <= 1.2
    assert (resized_float(noise(48, 71), 30, 90, how).max() > 255) == (how == "bicubic")
