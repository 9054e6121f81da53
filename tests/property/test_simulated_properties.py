"""What must hold of simulated motion, truth and pictures whatever the settings are."""

import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from retraverse.datasets.simulated import (
    Camera,
    Disturbances,
    MotionKind,
    SimulatedDrive,
    SimulatedRoute,
    simulate_route,
)
from retraverse.datasets.simulated.motion import KINDS, plan_motion
from retraverse.errors import ConfigError

UNIT = st.floats(0.0, 1.0)
SEEDS = st.integers(0, 2**20)
NAMES = [field.name for field in fields(Disturbances)]
TINY = Camera(width=64, height=48, supersampling=1)
DRIVE = simulate_route(3, 12, query=Disturbances(night=0.7, traffic=1.0), camera=TINY).query
FRAMES = [frame.tobytes() for frame in DRIVE]


@given(
    kind=st.sampled_from(KINDS),
    length=st.floats(10.0, 400.0),
    spacing=st.floats(0.5, 5.0),
    speed=UNIT,
    stops=UNIT,
    revisits=UNIT,
    seed=SEEDS,
)
def test_motion_stays_within_its_bounds(
    kind: MotionKind,
    length: float,
    spacing: float,
    speed: float,
    stops: float,
    revisits: float,
    seed: int,
) -> None:
    profile = plan_motion(
        kind,
        length_m=length,
        spacing_m=spacing,
        speed_change=speed,
        stops=stops,
        revisits=revisits,
        seed=seed,
    )
    motion = profile.frames(seed)
    positions = motion.positions_m
    assert (np.isnan(positions) == ~motion.on_route).all()
    if kind != "detour":
        assert motion.on_route.all()
    on_route = positions[motion.on_route]
    assert on_route.min() >= -1e-9
    assert on_route.max() <= length + 1e-9
    driven = sum(abs(leg.end_m - leg.start_m) for leg in profile.legs)
    moving = driven / spacing
    assert 2**-speed * moving - 1 <= len(motion)
    assert len(motion) <= (2**speed * moving + 1) * (1 + 0.5 * stops) + 1
    steps = np.abs(np.diff(positions))
    if kind == "forward" and revisits == 0:
        moved = steps[steps > 0]
        assert (moved >= spacing * 2**-speed * (1 - 1e-9)).all()
        assert (moved <= spacing * 2**speed * (1 + 1e-9)).all()


@given(seed=SEEDS, n_frames=st.integers(2, 60), stops=UNIT, speed=UNIT, revisits=UNIT)
def test_truth_is_the_distance_along_the_route(
    seed: int, n_frames: int, stops: float, speed: float, revisits: float
) -> None:
    query = Disturbances(stops=stops, speed_change=speed, revisits=revisits)
    route = _on_one_street(seed, n_frames, query)
    for radius in (0.0, 2.0, 5.0):
        truth = route.truth(radius)
        assert len(truth) == len(route.query)
        for position, found in zip(route.query.positions_m, truth, strict=True):
            near = {j for j in range(n_frames) if abs(2.0 * j - position) <= radius}
            assert set(found.tolist()) == near
    assert sum(len(found) > 0 for found in route.truth(2.0)) >= len(route.query) - 1


def _on_one_street(seed: int, n_frames: int, query: Disturbances) -> SimulatedRoute:
    """Return a route that is never rendered: what differs is how it is driven."""
    street = DRIVE.street
    drives = []
    for d in (Disturbances(), query):
        profile = plan_motion(
            length_m=2.0 * n_frames,
            speed_change=d.speed_change,
            stops=d.stops,
            revisits=d.revisits,
            seed=seed,
        )
        drives.append(SimulatedDrive(street, profile.frames(seed), d, camera=TINY, seed=seed))
    return SimulatedRoute(*drives)


@settings(max_examples=15, deadline=None)
@given(order=st.lists(st.integers(0, 11), min_size=1, max_size=6))
def test_any_order_gives_the_same_pixels(order: list[int]) -> None:
    assert [DRIVE[i].tobytes() for i in order] == [FRAMES[i] for i in order]


@given(
    start=st.integers(-15, 15) | st.none(),
    stop=st.integers(-15, 15) | st.none(),
    step=st.integers(-4, 4).filter(bool) | st.none(),
)
def test_slices_have_the_positions_of_their_frames(
    start: int | None, stop: int | None, step: int | None
) -> None:
    part = DRIVE[start:stop:step]
    assert part.positions_m.tolist() == DRIVE.positions_m.tolist()[start:stop:step]
    assert len(part) == len(range(12)[start:stop:step])


@given(name=st.sampled_from(NAMES), value=st.floats())
def test_strengths_are_from_0_to_1(name: str, value: float) -> None:
    if not math.isnan(value) and 0 <= value <= 1:
        assert getattr(Disturbances(**{name: value}), name) == value
    else:
        with pytest.raises(ConfigError, match=name):
            Disturbances(**{name: value})
