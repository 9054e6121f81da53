"""GIST: its layout, what its values answer to, sizes, flat pictures, wrong parameters."""

from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.images import Frame


def values(image: Any, **parameters: Any) -> Any:
    """Return the descriptor as (scale, orientation, row of blocks, column)."""
    technique = rt.technique("gist", **parameters)
    frame = Frame.from_array(image, name="picture", index=0)
    return technique.describe(technique.read(frame))["descriptor"].reshape(4, 8, 4, 4)


def grating(size: int, cycles_a_pixel: float, degrees: float) -> Any:
    """Return a wave that runs along the direction given: 0 = along x, 90 = down."""
    y, x = np.indices((size, size))
    along = x * np.cos(np.radians(degrees)) + y * np.sin(np.radians(degrees))
    return (128 + 100 * np.sin(2 * np.pi * cycles_a_pixel * along)).astype(np.uint8)


@pytest.mark.parametrize("resolution", [16, 20, 32, 64, 128, 256, 512, 1024])
def test_512_values_of_length_1_at_every_size(resolution: int) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (60, 90)).astype(np.uint8)
    descriptor = values(picture, resolution=resolution)
    assert descriptor.size == rt.technique("gist", resolution=resolution).layout.dimension == 512
    assert descriptor.dtype == np.float32
    assert descriptor.min() >= 0
    assert np.linalg.norm(descriptor) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("scale", [0, 1, 2])
@pytest.mark.parametrize("orientation", range(8))
def test_a_grating_answers_at_its_scale_and_direction(scale: int, orientation: int) -> None:
    # A filter looks for waves in direction -180 orientation / 8; a wave has no front and back.
    picture = grating(128, 0.3 / 1.85**scale, -22.5 * orientation)
    by_filter = values(picture, resolution=128).mean(axis=(2, 3))
    assert np.unravel_index(by_filter.argmax(), (4, 8)) == (scale, orientation)


@pytest.mark.parametrize(("row", "column"), [(0, 0), (0, 3), (2, 1), (3, 3)])
def test_structure_answers_where_it_is(row: int, column: int) -> None:
    picture = np.full((128, 128), 100, np.uint8)
    speckle = np.random.default_rng(1).integers(0, 256, (32, 32))
    picture[32 * row : 32 * row + 32, 32 * column : 32 * column + 32] = speckle
    by_block = values(picture, resolution=128).mean(axis=(0, 1))
    assert np.unravel_index(by_block.argmax(), (4, 4)) == (row, column)


def test_brightness_and_contrast_are_stretched_away() -> None:
    picture = np.random.default_rng(2).integers(0, 100, (64, 64)).astype(np.uint8)
    np.testing.assert_allclose(
        values(picture, resolution=64), values(picture * 2 + 40, resolution=64), atol=1e-6
    )


@pytest.mark.parametrize("level", [0, 17, 255])
def test_a_flat_picture_has_no_descriptor(level: int) -> None:
    assert not values(np.full((50, 70), level, np.uint8)).any()


def test_any_picture_is_resized_by_pillow() -> None:
    from PIL import Image

    picture = np.random.default_rng(3).integers(0, 256, (90, 170)).astype(np.uint8)
    small = np.asarray(Image.fromarray(picture).resize((32, 32)))
    np.testing.assert_array_equal(values(picture, resolution=32), values(small, resolution=32))


def test_grey_paths_differ_only_for_files() -> None:
    colour = np.random.default_rng(4).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    ours = values(colour, resolution=64, grey="decoder")
    np.testing.assert_array_equal(ours, values(colour, resolution=64, grey="from_colour"))


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"resolution": 12}, "16 to 1024"),
        ({"resolution": 1028}, "16 to 1024"),
        ({"resolution": 34}, "multiple of 4"),
        ({"transforms": "half"}, "'cropped', 'full'"),
        ({"grey": "green"}, "'decoder', 'from_colour'"),
    ],
)
def test_parameters_out_of_range(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        rt.technique("gist", **parameters)
