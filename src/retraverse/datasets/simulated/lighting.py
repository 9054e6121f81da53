"""How much light falls where: sun by orientation, street lamps by distance, own headlights."""

import math

import numpy as np

from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.path import Metres
from retraverse.datasets.simulated.street import Street
from retraverse.datasets.simulated.things import Building, Lamp
from retraverse.types import FloatArray

__all__ = ["SUN_ELEVATION", "lamp_light", "light_on_thing", "sun_along", "wall_light"]

SUN_ELEVATION = math.radians(43)
LAMP_COLOUR = np.array([1.0, 0.80, 0.52], np.float32)


def sun_along(street: Street, s: float) -> tuple[float, float]:
    """Return the level direction towards the sun as (along the street, to its right)."""
    angle = float(street.line.heading_at(s)) - street.sun_azimuth
    return math.cos(angle), math.sin(angle)


def lamp_light(
    lamps: tuple[Lamp, ...], s: Metres, d: Metres, z: Metres, power: float
) -> FloatArray:
    """Return the light of street lamps at places (any shape), shape (..., 3)."""
    total = np.zeros(np.broadcast(s, d, z).shape)
    for lamp in lamps:
        head = lamp.lateral_m - math.copysign(1.1, lamp.lateral_m)
        square = (s - lamp.key_m) ** 2 + (d - head) ** 2 + (z - lamp.height_m + 0.6) ** 2
        total += power / (square + 5.0)
    return total[..., None].astype(np.float32) * LAMP_COLOUR


def wall_light(street: Street, look: Look, building: Building, surface: str) -> FloatArray:
    """Return the light on a house's front, end wall or roof as a coarse grid.

    Parameters
    ----------
    street, look, building
    surface : {"front", "end", "roof"}

    Returns
    -------
    light : float32, shape (6, 9, 3)
        Top row first; columns from the start to the end, or from the street outwards.
    """
    middle = (building.start_m + building.end_m) / 2
    along, right = sun_along(street, middle)
    facing = {"front": -building.side * right, "end": -along, "roof": -0.6 * building.side * right}
    level = math.cos(SUN_ELEVATION) * facing[surface]
    if surface == "roof":
        level += 0.75 * math.sin(SUN_ELEVATION)
    base = look.ambient + look.sun * np.float32(1.25 * max(level, 0.0))
    grid = np.broadcast_to(base, (6, 9, 3)).astype(np.float32)
    if look.lamps <= 0 or building.is_backdrop:
        return grid
    height = np.linspace(building.eaves_m, 0, 6)[:, None]
    across = np.linspace(0, 1, 9)[None, :]
    lamps = street.lamps_near(middle)
    d = building.side * (building.front_m + (across * building.depth_m if surface == "end" else 0))
    s = building.start_m + (0 if surface == "end" else across * (building.end_m - building.start_m))
    power = {"front": 16.0, "end": 9.0, "roof": 2.0}[surface] * look.lamps
    return grid + lamp_light(lamps, np.asarray(s, float), np.asarray(d, float), height, power)


def light_on_thing(street: Street, look: Look, s: float, d: float, ahead_m: float) -> FloatArray:
    """Return the light on a thing about 1 m above the ground, `ahead_m` before the camera."""
    light = look.ambient + look.sun * np.float32(0.75)
    if look.lamps <= 0:
        return light
    lamps = street.lamps_near(s, 18.0)
    own = 0.5 * look.lamps * math.exp(-max(ahead_m, 0.0) / 18.0)
    at = lamp_light(lamps, np.array(s), np.array(d), np.array(1.0), 14.0 * look.lamps)
    return light + at + np.array([1.0, 0.95, 0.84], np.float32) * np.float32(own)
