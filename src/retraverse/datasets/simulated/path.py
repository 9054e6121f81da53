"""The centre line of the street: a seeded curve with gentle bends.

A place is named by `(s, d)`: `s` metres along the centre line, `d` metres to the right of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from retraverse.datasets.simulated.camera import Points

__all__ = ["CentreLine", "Metres", "make_centre_line"]

Metres = NDArray[np.float64]

BEFORE_M, AFTER_M = 80.0, 420.0
"""The line goes on this far before 0 and after the route's end, so that there is a view."""


@dataclass(frozen=True)
class CentreLine:
    """A curve sampled every metre; headings in radians, counter-clockwise from x."""

    s: Metres
    x: Metres
    y: Metres
    heading: Metres

    def heading_at(self, s: Metres | float) -> Metres:
        """Return the direction of the street at `s`."""
        return np.asarray(np.interp(s, self.s, self.heading))

    def points(self, s: Metres | float, d: Metres | float, z: Metres | float = 0.0) -> Points:
        """Return world points (..., 3) for places `(s, d)` at height `z`."""
        s = np.atleast_1d(np.asarray(s, float))
        heading = self.heading_at(s)
        world = np.empty((*np.broadcast_shapes(s.shape, np.shape(d)), 3))
        world[..., 0] = np.interp(s, self.s, self.x) + d * np.sin(heading)
        world[..., 1] = np.interp(s, self.s, self.y) - d * np.cos(heading)
        world[..., 2] = z
        return world


def make_centre_line(seed: int, length_m: float) -> CentreLine:
    """Return a curve whose bends stay wider than about 110 m radius."""
    rng = np.random.default_rng([seed, 1])
    s = np.arange(-BEFORE_M, length_m + AFTER_M, 1.0)
    curvature = np.zeros_like(s)
    for wavelength, radius in ((410.0, 330.0), (235.0, 380.0), (133.0, 520.0)):
        stretch, phase = rng.uniform(0.8, 1.2), rng.uniform(0, 2 * np.pi)
        curvature += np.sin(2 * np.pi * s / (wavelength * stretch) + phase) / radius
    heading = np.cumsum(curvature)
    x, y = np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))
    return CentreLine(s=s, x=x, y=y, heading=heading)
