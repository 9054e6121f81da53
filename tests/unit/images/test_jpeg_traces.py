"""What JPEG took out of a picture is seen in its pixels, and only what JPEG took."""

import numpy as np
import pytest
from skimage import data

from retraverse.errors import ShapeError
from retraverse.images import STRONG_TRACES, decode_bgr, encode_jpeg, jpeg_traces
from retraverse.images.decode import to_rgb
from retraverse.types import ImageArray

ASTRONAUT, CAT, COFFEE = (
    np.asarray(getattr(data, name)(), np.uint8) for name in ("astronaut", "chelsea", "coffee")
)
PHOTOGRAPHS = (ASTRONAUT, CAT, COFFEE)


def through_jpeg(picture: ImageArray, compression: int) -> ImageArray:
    return to_rgb(decode_bgr(encode_jpeg(picture, compression)), "bgr")


def small(picture: ImageArray, width: int = 160, height: int = 120) -> ImageArray:
    import cv2

    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


@pytest.mark.parametrize("picture", [small(one) for one in PHOTOGRAPHS])
def test_the_stronger_the_compression_the_clearer_the_traces(picture: ImageArray) -> None:
    assert jpeg_traces(picture) < 0.1
    traces = [jpeg_traces(through_jpeg(picture, c)) for c in (0, 50, 80, 90, 97)]
    assert traces == sorted(traces)
    assert traces[1] < STRONG_TRACES < traces[-1]


def test_a_share_of_the_frequencies_that_the_file_sets_to_zero() -> None:
    """Where everything but the means is silenced, all that was not silent before is traces."""
    picture = small(ASTRONAUT)
    means = picture.reshape(15, 8, 20, 8, 3).mean(axis=(1, 3)).astype(np.uint8)
    blocks = np.repeat(np.repeat(means, 8, axis=0), 8, axis=1)
    assert jpeg_traces(blocks) == pytest.approx(1.0)


def test_grey_pictures_and_pictures_cropped_at_their_end() -> None:
    compressed = through_jpeg(small(CAT), 97)
    grey = np.ascontiguousarray(COFFEE[:200, :300, 1])
    seen = decode_bgr(encode_jpeg(grey, 97))
    assert jpeg_traces(seen if seen.ndim == 2 else seen[..., 0]) > STRONG_TRACES
    assert jpeg_traces(compressed[:-3, :-5]) > STRONG_TRACES


def test_the_grid_is_lost_by_moving_and_by_resizing() -> None:
    compressed = through_jpeg(small(COFFEE), 97)
    assert jpeg_traces(compressed[4:, 4:]) < 0.1
    assert jpeg_traces(small(compressed, 200, 150)) < STRONG_TRACES


@pytest.mark.parametrize("shape", [(8, 8, 3), (23, 200), (300, 20, 3)])
def test_too_small_to_tell(shape: tuple[int, ...]) -> None:
    noise = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    assert jpeg_traces(noise) == 0


def test_one_colour_has_no_traces() -> None:
    assert jpeg_traces(np.full((64, 64, 3), 90, np.uint8)) == 0


def test_large_pictures_are_looked_at_in_part_and_judged_alike() -> None:
    photograph = np.tile(ASTRONAUT, (3, 4, 1))
    assert jpeg_traces(photograph) < 0.1
    assert jpeg_traces(through_jpeg(photograph, 97)) > STRONG_TRACES


def test_what_is_no_picture() -> None:
    with pytest.raises(ShapeError):
        jpeg_traces(np.zeros((40, 40, 2), np.uint8))
