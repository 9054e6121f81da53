"""Which frames count as standing still, through noise and light, and what is left."""

import numpy as np
import pytest

from retraverse.errors import ConfigError
from retraverse.images import Traverse, measure_motion, open_traverse, without_stops
from retraverse.types import ImageArray

# Where the camera is at each of 20 frames: it stands at 3 (five frames) and at 7 (seven frames).
PLACES = [0, 1, 2, 3, 3, 3, 3, 3, 4, 5, 6, 7, 7, 7, 7, 7, 7, 7, 8, 9]
ARRIVALS = [0, 1, 2, 3, 8, 9, 10, 11, 18, 19]


def drive(places: list[int], noise: float = 0.0, light: float = 0.0, seed: int = 0) -> Traverse:
    """Return views of a random street; every frame with its own noise and exposure."""
    random = np.random.default_rng(seed)
    scene = np.kron(random.integers(60, 180, (15, 60)), np.ones((8, 8)))
    frames: list[ImageArray] = []
    for place in places:
        view = scene[:, 16 * place : 16 * place + 160] * (1 + random.uniform(-light, light))
        noisy = view + random.normal(0, noise, view.shape) if noise else view
        frames.append(np.clip(noisy, 0, 255).astype(np.uint8))
    return open_traverse(frames)


@pytest.mark.parametrize(("noise", "light"), [(0, 0), (6, 0), (0, 0.3), (6, 0.3)])
def test_each_place_is_kept_once(noise: float, light: float) -> None:
    moving = without_stops(drive(PLACES, noise, light))
    np.testing.assert_array_equal(moving.indices, ARRIVALS)
    assert moving.source.endswith("10 frames without motion (below 0.05) removed")


def test_a_drive_that_moves_is_left_as_it_is() -> None:
    traverse = drive(list(range(12)))
    assert without_stops(traverse) is traverse


def test_nothing_is_dropped_below_zero_motion() -> None:
    traverse = drive([4] * 5)
    assert without_stops(traverse, 0) is traverse
    assert len(without_stops(traverse)) == 1
    assert len(without_stops(traverse[:0])) == 0


def test_slow_motion_adds_up() -> None:
    """A camera that creeps 2 px a frame moves less than the threshold each time, but moves."""
    random = np.random.default_rng(1)
    scene = np.kron(random.integers(60, 180, (4, 20)), np.ones((40, 40))).astype(np.uint8)
    creeping = open_traverse([scene[:, 2 * i : 2 * i + 320] for i in range(60)])
    step = float(np.median(measure_motion(creeping)))
    kept = without_stops(creeping, 3 * step)
    assert 8 <= len(kept) <= 30
    assert measure_motion(kept).min() >= 3 * step


def test_noise_in_the_dark_is_no_motion() -> None:
    random = np.random.default_rng(2)
    dark = open_traverse([random.integers(0, 6, (120, 160)).astype(np.uint8) for _ in range(9)])
    assert len(without_stops(dark)) == 1


def test_motion_is_measured_between_neighbours() -> None:
    motion = measure_motion(drive(PLACES))
    assert motion.shape == (19,)
    np.testing.assert_array_equal(motion == 0, np.diff(PLACES) == 0)
    assert motion[motion > 0].min() > 0.1
    assert measure_motion(drive([0])).shape == (0,)


@pytest.mark.parametrize("min_motion", [-0.1, float("nan"), float("inf")])
def test_impossible_motion_is_refused(min_motion: float) -> None:
    with pytest.raises(ConfigError, match="at least 0"):
        without_stops(drive([0, 1]), min_motion)
