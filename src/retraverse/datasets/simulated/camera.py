"""The pinhole camera: where it stands and where a point of the world falls in its picture.

Conventions
- World: x, y on the ground, z up, metres; headings are counter-clockwise from x, radians.
- Camera space: x to the right, y down, z forward (depth), metres; the optical axis stays
  level, and pitch only shifts the horizon, so that upright edges stay upright.
- Pictures: columns to the right, rows down, pixel centres at half-integers.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError

__all__ = ["NEAR_M", "Camera", "Points", "View"]

Points = NDArray[np.float64]
"""Points, one per row: (n, 3) in space or (n, 2) in a picture."""

NEAR_M = 0.5
"""Nothing nearer than this (depth, metres) is drawn."""


@dataclass(frozen=True)
class Camera:
    """A forward-looking camera behind a windscreen.

    Raises
    ------
    ConfigError
        A size below 16 pixels, a field of view outside 20..140 degrees, and so on.
    """

    width: int = 320
    """Pixels."""
    height: int = 240
    """Pixels."""
    field_of_view_deg: float = 78.0
    """Horizontal opening angle."""
    height_m: float = 1.5
    """Above the road."""
    horizon: float = 0.56
    """Row of the horizon, as a part of the height, from the top."""
    supersampling: int = 2
    """Pictures are painted this many times larger and averaged down: smooth edges."""

    def __post_init__(self) -> None:
        _check("width", self.width, 16, 4096, is_whole=True)
        _check("height", self.height, 16, 4096, is_whole=True)
        _check("field_of_view_deg", self.field_of_view_deg, 20, 140)
        _check("height_m", self.height_m, 0.3, 5.0)
        _check("horizon", self.horizon, 0.2, 0.8)
        _check("supersampling", self.supersampling, 1, 4, is_whole=True)

    @cached_property
    def focal(self) -> float:
        """Focal length in pixels of the enlarged picture."""
        half = math.tan(math.radians(self.field_of_view_deg) / 2)
        return self.width * self.supersampling / 2 / half

    @cached_property
    def canvas(self) -> tuple[int, int]:
        """(height, width) of the enlarged picture."""
        return self.height * self.supersampling, self.width * self.supersampling


def _check(name: str, value: object, low: float, high: float, *, is_whole: bool = False) -> None:
    kinds = (int, np.integer) if is_whole else (int, float, np.number)
    is_number = isinstance(value, kinds) and not isinstance(value, bool)
    if not (is_number and low <= value <= high):  # type: ignore[operator]
        kind = "an integer from" if is_whole else "a number from"
        raise ConfigError(f"camera {name} is {value!r}; expected {kind} {low} to {high}")


@dataclass(frozen=True)
class View:
    """A camera at one place: turns world points into pixels of the enlarged picture."""

    camera: Camera
    x: float
    y: float
    heading: float
    position_m: float
    """Along the street."""
    lateral_m: float
    """Right of the centre line."""
    pitch: float = 0.0
    """Radians, positive looks up."""

    @cached_property
    def centre(self) -> tuple[float, float]:
        """Column and row of the vanishing point straight ahead."""
        height, width = self.camera.canvas
        return width / 2, height * self.camera.horizon + self.pitch * self.camera.focal

    def to_camera(self, world: Points) -> Points:
        """Return world points (..., 3) in camera space (..., 3)."""
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        dx, dy = world[..., 0] - self.x, world[..., 1] - self.y
        points = np.empty(world.shape)
        points[..., 0] = dx * sine - dy * cosine
        points[..., 1] = self.camera.height_m - world[..., 2]
        points[..., 2] = dx * cosine + dy * sine
        return points

    def project(self, points: Points) -> Points:
        """Return the pixels (n, 2) of camera-space points (n, 3) in front of the camera."""
        scale = self.camera.focal / points[:, 2]
        pixels = np.empty((len(points), 2))
        column, row = self.centre
        pixels[:, 0] = points[:, 0] * scale + column
        pixels[:, 1] = points[:, 1] * scale + row
        return pixels
