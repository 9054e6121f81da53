"""Planes and back: grey exactly, colour as nearly as half the size allows."""

import numpy as np
import pytest

from retraverse.images.colour_planes import coded_size, from_planes, to_planes


@pytest.mark.parametrize(
    ("size", "coded"),
    [((64, 64), (64, 64)), ((1, 65), (64, 66)), ((121, 90), (122, 90)), ((240, 320), (240, 320))],
)
def test_sides_are_even_and_not_too_small(size: tuple[int, int], coded: tuple[int, int]) -> None:
    assert coded_size(*size) == coded


@pytest.mark.parametrize("size", [(64, 64), (1, 65), (121, 90)])
def test_grey_comes_back_exactly(size: tuple[int, int]) -> None:
    picture = np.random.default_rng(2).integers(0, 256, size, np.uint8)
    planes = to_planes(picture)
    assert planes[0].shape == coded_size(*size)
    assert all((plane == 128).all() for plane in planes[1:])
    np.testing.assert_array_equal(from_planes(planes, *size, grey=True), picture)


@pytest.mark.parametrize("size", [(64, 64), (1, 65), (121, 90)])
def test_even_colours_come_back_within_rounding(size: tuple[int, int]) -> None:
    for colour in ((0, 0, 0), (255, 255, 255), (200, 30, 90), (10, 250, 40)):
        picture = np.full((*size, 3), colour, np.uint8)
        planes = to_planes(picture)
        height, width = planes[0].shape
        assert planes[1].shape == planes[2].shape == (height // 2, width // 2)
        back = from_planes(planes, *size, grey=False)
        assert back.shape == picture.shape
        assert np.abs(back.astype(int) - picture).max() <= 2
