"""The street as data: the same for a seed, sensible to walk along, and checked."""

from itertools import pairwise

import numpy as np
import pytest

from retraverse.datasets.simulated import Street, make_street
from retraverse.datasets.simulated.street import FRONT_M, LANE_M
from retraverse.datasets.simulated.things import Building, Lamp, ParkedCar
from retraverse.errors import ConfigError

STREETS = [make_street(seed, 300.0) for seed in range(4)]


def houses(street: Street, side: int) -> list[Building]:
    """Return the houses in the first row of one side."""
    row = [t for t in street.things if isinstance(t, Building) and not t.is_backdrop]
    return [house for house in row if house.side == side]


def test_a_seed_is_a_street() -> None:
    assert make_street(2, 300.0).things == STREETS[2].things
    assert all(STREETS[i].things != STREETS[j].things for i in range(4) for j in range(i))


def test_a_longer_street_begins_alike() -> None:
    short, long = make_street(5, 100.0), make_street(5, 700.0)
    assert short.things_between(-40, 200) == long.things_between(-40, 200)
    s = np.linspace(-40, 200, 49)
    assert np.allclose(short.line.points(s, 0.0), long.line.points(s, 0.0))


@pytest.mark.parametrize("street", STREETS)
def test_things_are_sorted_and_reach_beyond_the_route(street: Street) -> None:
    keys = [thing.key_m for thing in street.things]
    assert keys == sorted(keys)
    assert keys[0] < 0
    assert keys[-1] > street.length_m + 150


@pytest.mark.parametrize("street", STREETS)
@pytest.mark.parametrize("side", [-1, 1])
def test_houses_stand_in_a_row_behind_the_pavement(street: Street, side: int) -> None:
    row = houses(street, side)
    assert len(row) > 10
    gaps = [b.start_m - a.end_m for a, b in pairwise(row)]
    assert min(gaps) >= -1e-9, "houses overlap"
    assert all(house.front_m >= FRONT_M for house in row)


@pytest.mark.parametrize("street", STREETS)
def test_nothing_stands_in_the_lanes(street: Street) -> None:
    for thing in street.things:
        if not isinstance(thing, Building):
            half = 0.98 if isinstance(thing, ParkedCar) else 0.0
            assert abs(thing.lateral_m) - half > LANE_M - 0.15, thing


def test_lamps_near_are_the_lamps_near() -> None:
    street = STREETS[0]
    for s in (0.0, 55.0, 222.0):
        near = [t for t in street.things if isinstance(t, Lamp) and -32 <= t.key_m - s < 32]
        assert list(street.lamps_near(s)) == near
        assert len(near) >= 2


@pytest.mark.parametrize("street", STREETS)
def test_bends_are_gentle_and_places_true_to_scale(street: Street) -> None:
    line = street.line
    assert np.abs(np.diff(line.heading)).max() < 1 / 100
    steps = np.diff(line.points(np.arange(0.0, 300.0), 0.0), axis=0)
    assert np.linalg.norm(steps, axis=1) == pytest.approx(1.0, abs=0.01)
    beside = line.points(np.arange(0.0, 300.0), 3.0) - line.points(np.arange(0.0, 300.0), 0.0)
    assert np.linalg.norm(beside, axis=1) == pytest.approx(3.0)


@pytest.mark.parametrize("seed", [-1, 1.5, "1", True])
def test_a_seed_is_a_whole_number(seed: int) -> None:
    with pytest.raises(ConfigError, match="seed"):
        make_street(seed, 100.0)


@pytest.mark.parametrize("length", [0.0, -5.0, 1e9, float("nan")])
def test_a_length_out_of_range_is_refused(length: float) -> None:
    with pytest.raises(ConfigError, match="length_m"):
        make_street(0, length)
