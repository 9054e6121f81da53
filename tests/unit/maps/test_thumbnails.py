import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError
from retraverse.maps.thumbnails import ThumbnailSpec, encode_thumbnail
from retraverse.types import Array


def decode(encoded: bytes) -> Array:
    image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert image is not None
    return image


@pytest.mark.parametrize(
    ("size", "max_side", "expected"),
    [
        ((480, 640), 160, (120, 160)),
        ((640, 480), 160, (160, 120)),
        ((20, 30), 160, (20, 30)),  # never enlarged
        ((2, 1000), 100, (1, 100)),  # never without a row
    ],
)
def test_longest_side(size: tuple[int, int], max_side: int, expected: tuple[int, int]) -> None:
    image = np.zeros((*size, 3), np.uint8)
    assert decode(encode_thumbnail(image, ThumbnailSpec(max_side))).shape == (*expected, 3)


def test_colours_keep_their_order() -> None:
    image = np.zeros((32, 32, 3), np.uint8)
    image[..., 0] = 250
    encoded = encode_thumbnail(image, ThumbnailSpec(32))
    red, green, blue = decode(encoded)[16, 16]
    assert red > 200
    assert max(green, blue) < 50


@pytest.mark.parametrize("max_side", [0, 15, 4097, -1])
def test_size_out_of_range(max_side: int) -> None:
    with pytest.raises(ConfigError, match=f"longest side of {max_side} pixels, expected 16 to"):
        ThumbnailSpec(max_side)


@pytest.mark.parametrize("quality", [0, 101])
def test_quality_out_of_range(quality: int) -> None:
    with pytest.raises(ConfigError, match=f"quality {quality}, expected 1 to 100"):
        ThumbnailSpec(160, quality)
