"""What differs between two drives, and the light, colours and haze that follow from it.

`Disturbances` is what the user sets, every field from 0 (as the reference) to 1 (as strong as
it gets). `Look` is what the painters read: derived once per drive, never set by hand.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from retraverse.datasets.simulated.noise import blend, smooth_step
from retraverse.errors import ConfigError
from retraverse.types import FloatArray

__all__ = ["Disturbances", "Look", "make_look"]


@dataclass(frozen=True)
class Disturbances:
    """How a drive differs from an undisturbed one; every field is in [0, 1].

    At 0 everywhere, a frame depends on the street and the position alone, so two drives give
    identical pictures at the same place.

    Raises
    ------
    ConfigError
        A value is not a number from 0 to 1; the message names the field.
    """

    lateral_shift: float = 0.0
    """Camera moved sideways, to the left: 1 = half a lane (1.6 m), with true parallax."""
    season: float = 0.0
    """0 summer, about 0.45 autumn, 0.7 bare trees, 1 snow on ground, roofs and branches."""
    night: float = 0.0
    """0 day, 0.5 dusk, 1 night: lamps, lit windows, headlights, and sensor noise that grows."""
    traffic: float = 0.0
    """Moving cars, people, and parked cars that came or went since; differs with the seed."""
    fog: float = 0.0
    """0 clear (sight about 400 m), 1 dense (about 35 m)."""
    rain: float = 0.0
    """Overcast sky, wet dark road, streaks; no direct sun, so no shadows."""
    vibration: float = 0.0
    """Heading (standard deviation 0.75 degrees) and pitch jitter, weaving in the lane (0.3 m)."""
    speed_change: float = 0.0
    """Smoothly varying speed; at 1 between half and twice the nominal speed."""
    stops: float = 0.0
    """Standing still; at 1 about one frame in three."""
    revisits: float = 0.0
    """Part of the route is driven again after a return to it; at 1 about half of the route."""

    def __post_init__(self) -> None:
        for field in fields(self):
            _check_unit(field.name, getattr(self, field.name))


def _check_unit(name: str, value: object) -> None:
    """Raise unless `value` is a real number in [0, 1]."""
    is_number = isinstance(value, int | float | np.floating) and not isinstance(value, bool)
    if not (is_number and 0.0 <= float(value) <= 1.0):  # type: ignore[arg-type]
        raise ConfigError(f"{name} is {value!r}; expected a number from 0 (none) to 1 (strongest)")


@dataclass(frozen=True)
class Look:
    """Light, colours and haze of one drive; colours are float32 RGB in 0..255, light about 0..1."""

    sun: FloatArray
    """Light added to a surface that faces the sun."""
    ambient: FloatArray
    """Light that reaches every surface."""
    lamps: float
    """0 street lamps off, 1 fully on."""
    snow: float
    """Part of the ground and roofs that snow covers."""
    leaves: float
    """Part of the leaves still on the trees."""
    autumn: float
    """How far leaves have turned."""
    zenith: FloatArray
    horizon: FloatArray
    haze: FloatArray
    """Colour that far things fade to."""
    sight_m: float
    """Distance at which 63 % of a thing's colour is haze."""
    clouds: float
    """Part of the sky under cloud."""
    wet: float
    """Wetness of the road, 0..1."""
    darkness: float
    """Noise, glow and headlights scale with this (`Disturbances.night`)."""
    rain: float


def _rgb(red: float, green: float, blue: float) -> FloatArray:
    return np.array([red, green, blue], np.float32)


def _through_night(day: FloatArray, dusk: FloatArray, dark: FloatArray, night: float) -> FloatArray:
    """Return a colour between day, dusk and dark."""
    return blend(day, dusk, night * 2) if night < 0.5 else blend(dusk, dark, night * 2 - 1)


def make_look(disturbances: Disturbances) -> Look:
    """Return the light, colours and haze that follow from the disturbances."""
    d = disturbances
    day = (1.0 - d.night) ** 1.4
    overcast = 1.0 - (1.0 - 0.8 * smooth_step(0.35, 1.0, d.season)) * (1.0 - d.rain) * (
        1.0 - 0.9 * d.fog
    )
    sun_colour = blend(_rgb(0.62, 0.55, 0.43), _rgb(0.75, 0.42, 0.20), min(1.0, 2 * d.night))
    ambient = blend(_rgb(0.60, 0.62, 0.67), _rgb(0.84, 0.86, 0.89), overcast)
    ambient = ambient * np.float32(day * (1.0 - 0.18 * d.rain))
    zenith, horizon = _sky_colours(d.night, overcast)
    return Look(
        sun=sun_colour * np.float32(day * (1.0 - overcast)),
        ambient=ambient + _rgb(0.075, 0.085, 0.125) * np.float32(d.night),
        lamps=smooth_step(0.25, 0.8, d.night),
        snow=smooth_step(0.55, 1.0, d.season),
        leaves=1.0 - smooth_step(0.3, 0.75, d.season),
        autumn=smooth_step(0.05, 0.5, d.season),
        zenith=zenith,
        horizon=horizon,
        haze=blend(horizon, zenith, 0.15),
        sight_m=420.0 * math.exp(-2.5 * d.fog) * (1.0 - 0.5 * d.rain),
        clouds=0.45 + 0.55 * overcast,
        wet=d.rain,
        darkness=d.night,
        rain=d.rain,
    )


def _sky_colours(night: float, overcast: float) -> tuple[FloatArray, FloatArray]:
    """Return the colours of the sky overhead and at the horizon."""
    zenith = blend(_rgb(108, 162, 222), _rgb(190, 196, 204), overcast)
    horizon = blend(_rgb(218, 230, 240), _rgb(218, 221, 225), overcast)
    dusk_low = blend(_rgb(206, 138, 100), _rgb(112, 110, 118), overcast)
    return (
        _through_night(zenith, _rgb(62, 74, 112), _rgb(9, 11, 21), night),
        _through_night(horizon, dusk_low, _rgb(34, 33, 42), night),
    )
