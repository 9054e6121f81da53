import numpy as np
import pytest

from retraverse.errors import ConfigError
from retraverse.images import Worsening
from retraverse.studies.measuring.legibility import (
    CHARACTERS,
    LEGIBLE,
    read_characters,
    smallest_legible_height,
)


def test_large_writing_in_a_clean_picture_is_read() -> None:
    reading = read_characters(0.08, Worsening(), n_characters=36)
    assert reading.read_share == 1
    assert reading.n_characters == 36


def test_writing_below_a_pixel_is_guessed() -> None:
    # 1 px high after shrinking, coarsest JPEG: hardly better than one in 36.
    reading = read_characters(0.03, Worsening(32, compression=99))
    assert reading.read_share < 0.25


def test_shrinking_and_compressing_hide_writing() -> None:
    shares = [
        read_characters(0.04, worsening, n_characters=36).read_share
        for worsening in (Worsening(), Worsening(64), Worsening(64, compression=97))
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > LEGIBLE > shares[2]


def test_the_same_seed_reads_the_same() -> None:
    worsening = Worsening(64, compression=90)
    first, again = (read_characters(0.06, worsening, n_characters=36, seed=4) for _ in range(2))
    assert first == again


def test_the_smallest_height_is_legible_and_grows_with_damage() -> None:
    heights = [
        smallest_legible_height(worsening, n_characters=12, steps=3)
        for worsening in (Worsening(128), Worsening(32))
    ]
    assert 0.008 < heights[0] < heights[1] <= 0.25
    reading = read_characters(heights[1], Worsening(32), n_characters=12)
    assert reading.read_share >= LEGIBLE


def test_nothing_is_legible_in_one_pixel() -> None:
    assert smallest_legible_height(Worsening(1), n_characters=12, steps=2) == np.inf


@pytest.mark.parametrize("height", [0.001, 0.5])
def test_heights_out_of_range(height: float) -> None:
    with pytest.raises(ConfigError, match=f"character height: got {height}"):
        read_characters(height, Worsening())


def test_36_characters() -> None:
    assert len(set(CHARACTERS)) == 36
