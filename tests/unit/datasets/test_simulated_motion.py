"""Where the frames of a drive are: exact positions for every way of driving."""

import numpy as np
import pytest

from retraverse.datasets.simulated import Leg, MotionProfile, plan_motion
from retraverse.errors import ConfigError


def test_straight_ahead_is_even_steps() -> None:
    motion = plan_motion(length_m=20, spacing_m=2.5).frames()
    assert motion.positions_m.tolist() == [0, 2.5, 5, 7.5, 10, 12.5, 15, 17.5]
    assert motion.on_route.all()


def test_backwards_is_the_way_back() -> None:
    motion = plan_motion("backwards", length_m=20, spacing_m=5).frames()
    assert motion.positions_m.tolist() == [20, 15, 10, 5]


@pytest.mark.parametrize("seed", range(5))
def test_a_detour_leaves_the_route_and_comes_back_further_on(seed: int) -> None:
    motion = plan_motion("detour", length_m=200, spacing_m=2, seed=seed).frames(seed)
    off = np.flatnonzero(~motion.on_route)
    assert np.isnan(motion.positions_m[off]).all()
    assert not np.isnan(motion.positions_m[motion.on_route]).any()
    assert (np.diff(off) == 1).all()
    assert len(off) == pytest.approx(25, abs=1)
    before, after = motion.positions_m[off[0] - 1], motion.positions_m[off[-1] + 1]
    assert before == pytest.approx(80, abs=12)
    assert after - before == pytest.approx(30, abs=4)


@pytest.mark.parametrize("seed", range(5))
def test_a_jump_is_two_discontinuities_over_the_whole_route(seed: int) -> None:
    positions = plan_motion("jump", length_m=200, spacing_m=2, seed=seed).frames(seed).positions_m
    steps = np.diff(positions)
    assert (np.abs(steps) > 4).sum() == 2
    assert steps.max() == pytest.approx(70, abs=4)
    assert np.abs(np.diff(np.sort(positions))).max() < 4.1, "no part of the route is left out"


def test_a_stop_repeats_a_position() -> None:
    moving = plan_motion(length_m=240, stops=0).frames(3).positions_m
    positions = plan_motion(length_m=240, stops=1.0).frames(3).positions_m
    assert np.unique(positions).tolist() == moving.tolist(), "stops add frames, they move none"
    assert (np.diff(positions) == 0).mean() == pytest.approx(1 / 3, abs=0.02)
    assert (np.diff(positions) >= 0).all()


def test_revisits_drive_half_of_the_route_again() -> None:
    positions = plan_motion(length_m=400, revisits=1.0, seed=4).frames(4).positions_m
    steps = np.diff(positions)
    assert (steps < 0).sum() == 2
    assert len(positions) * 2.0 == pytest.approx(600, abs=4)
    assert positions.min() == 0
    assert positions.max() > 396


def test_speed_swings_within_its_bounds_and_smoothly() -> None:
    positions = plan_motion(length_m=2000, speed_change=1.0).frames(5).positions_m
    steps = np.diff(positions)
    assert 0.5 * 2 <= steps.min() < 1.3
    assert 2.8 < steps.max() <= 2 * 2
    assert np.abs(np.diff(np.log2(steps))).max() < 0.25
    assert positions[-1] + steps.max() >= 2000


def test_seeds_draw_different_speeds_and_stops() -> None:
    profile = plan_motion(length_m=100, speed_change=0.5, stops=0.5)
    assert profile.frames(1).positions_m.tolist() == profile.frames(1).positions_m.tolist()
    assert profile.frames(1).positions_m.tolist() != profile.frames(2).positions_m.tolist()


def test_legs_of_ones_own() -> None:
    profile = MotionProfile((Leg(10, 14), Leg(0, 4, on_route=False), Leg(9, 5)), spacing_m=2)
    motion = profile.frames()
    assert motion.places_m.tolist() == [10, 12, 0, 2, 9, 7]
    assert motion.on_route.tolist() == [True, True, False, False, True, True]
    assert len(motion) == 6


def test_an_unknown_kind_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"'sideways'.*forward, backwards, detour, jump"):
        plan_motion("sideways", length_m=10)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("length_m", 0.0),
        ("length_m", float("nan")),
        ("spacing_m", -1.0),
        ("spacing_m", float("inf")),
        ("speed_change", 1.5),
        ("stops", float("nan")),
        ("revisits", -0.1),
    ],
)
def test_a_wrong_value_is_named(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        plan_motion(**{"length_m": 100.0, name: value})  # type: ignore[arg-type]


def test_a_profile_needs_legs() -> None:
    with pytest.raises(ConfigError, match="no legs"):
        MotionProfile(())
