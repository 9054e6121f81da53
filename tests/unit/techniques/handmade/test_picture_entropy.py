import numpy as np
import pytest

import retraverse as rt
from retraverse.techniques.handmade.picture_entropy import picture_entropy


@pytest.mark.parametrize("shape", [(32, 64), (120, 160), (384, 1024), (512, 512)])
def test_it_is_what_regional_hog_stores(shape: tuple[int, int]) -> None:
    grey = np.random.default_rng(0).integers(0, 200, shape).astype(np.uint8)
    description = rt.technique("convsequential").describe(grey)
    assert picture_entropy(grey) == description["entropy"]


def test_a_flat_picture_has_none() -> None:
    assert picture_entropy(np.full((50, 70), 80, np.uint8)) == 0


def test_noise_reaches_the_ceiling() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (512, 512)).astype(np.uint8)
    assert 0.7 < picture_entropy(noise) < np.log2(81) / 8
