"""What differs between drives: ranges, the light that follows, and what pictures show of it."""

from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest

from retraverse.datasets.simulated import Disturbances, SimulatedDrive, SimulatedRoute
from retraverse.datasets.simulated.conditions import make_look
from retraverse.errors import ConfigError
from retraverse.types import FloatArray

NAMES = [field.name for field in fields(Disturbances)]
Picture = Callable[..., FloatArray]
Route = Callable[..., SimulatedRoute]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [-0.01, 1.01, float("nan"), float("inf"), "0.5", None, True])
def test_a_value_out_of_range_is_named(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"^{name} is .*expected a number from 0"):
        Disturbances(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [0, 1, np.float32(0.5), np.float64(0.5)])
def test_any_real_number_in_range_will_do(value: float) -> None:
    assert Disturbances(night=value).night == value


def test_light_falls_and_lamps_rise_with_night() -> None:
    looks = [make_look(Disturbances(night=night)) for night in (0, 0.25, 0.5, 0.75, 1)]
    light = [float((look.sun + look.ambient).sum()) for look in looks]
    assert light == sorted(light, reverse=True)
    assert len(set(light)) == 5
    assert looks[0].lamps == 0
    assert looks[-1].lamps == 1


def test_seasons_go_from_leaves_to_snow() -> None:
    summer, autumn, bare, winter = (make_look(Disturbances(season=s)) for s in (0, 0.45, 0.75, 1))
    assert (summer.leaves, summer.autumn, summer.snow) == (1, 0, 0)
    assert autumn.autumn > 0.9
    assert autumn.leaves > bare.leaves == 0
    assert (winter.leaves, winter.snow) == (0, 1)


def test_sight_in_fog_is_as_documented() -> None:
    sights = [make_look(Disturbances(fog=fog)).sight_m for fog in (0, 0.5, 1)]
    assert sights == sorted(sights, reverse=True)
    assert sights[0] == pytest.approx(400, rel=0.1)
    assert sights[2] == pytest.approx(35, rel=0.1)


def test_pictures_grow_darker_with_night(picture: Picture) -> None:
    day, dusk, night = (picture(night=night).mean() for night in (0.0, 0.5, 1.0))
    assert day > dusk > night


@pytest.mark.parametrize("name", ["lateral_shift", "fog", "season", "night"])
def test_stronger_is_further_from_the_reference(picture: Picture, name: str) -> None:
    plain = picture()
    some, most = (np.abs(picture(**{name: value}) - plain).mean() for value in (0.5, 1.0))
    assert 0 < some < most


def test_fog_hides_what_is_far(picture: Picture) -> None:
    ahead = np.s_[32:40, 40:56]
    assert picture(fog=1.0)[ahead].std() < 0.5 * picture()[ahead].std()


def test_noise_comes_with_the_night_alone(small_route: Route) -> None:
    def grain(night: float) -> float:
        """Return how much two drives differ that have all but the seed in common."""
        query = small_route(night=night).query
        other = SimulatedDrive(
            query.street, query.motion, query.disturbances, camera=query.camera, seed=77
        )
        return float(np.abs(query[12].astype(float) - other[12]).mean())

    day, dusk, night = (grain(night) for night in (0.0, 0.5, 1.0))
    assert day == 0
    assert 0 < dusk < night


def test_each_seed_has_its_own_traffic(small_route: Route) -> None:
    busy = small_route(traffic=1.0).query
    other = SimulatedDrive(
        busy.street, busy.motion, busy.disturbances, camera=busy.camera, seed=busy.seed + 1
    )
    empty = small_route().query
    assert np.mean([(busy[i] != empty[i]).any() for i in range(0, 24, 4)]) == 1
    assert np.mean([(busy[i] != other[i]).any() for i in range(0, 24, 4)]) == 1


def test_vibration_jitters_from_frame_to_frame(small_route: Route) -> None:
    steady, shaken = small_route().query, small_route(vibration=1.0).query
    assert all((steady[i] != shaken[i]).any() for i in (3, 4, 5))
    shared = shaken._shared
    headings = [shared.view(shaken.street, i).heading for i in range(24)]
    true = [float(shaken.street.line.heading_at(p)) for p in shaken.positions_m]
    off = np.degrees(np.array(headings) - true)
    assert 0.2 < off.std() < 1.5
    assert np.abs(off).max() < 3.0
