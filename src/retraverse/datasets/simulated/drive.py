"""Drives through a simulated street: frames rendered when asked for, and the exact truth.

Conventions
- A drive is a read-only sequence of RGB pictures; frame i never depends on which frames were
  rendered before, so any order, slice or number of passes gives the same pixels.
- Truth is a position along the route for every frame; NaN where the drive has left the route.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import overload
from weakref import WeakValueDictionary

import numpy as np

from retraverse.datasets.simulated.camera import Camera, View
from retraverse.datasets.simulated.conditions import Disturbances, make_look
from retraverse.datasets.simulated.motion import Motion, MotionKind, plan_motion
from retraverse.datasets.simulated.path import Metres
from retraverse.datasets.simulated.render import Painter
from retraverse.datasets.simulated.street import LANE_M, Street, make_street
from retraverse.datasets.simulated.traffic import Traffic
from retraverse.errors import ConfigError
from retraverse.types import BoolArray, ImageArray, IntArray

__all__ = ["SimulatedDrive", "SimulatedRoute", "simulate_route"]

FRAME_S = 0.25
"""Seconds between frames, for traffic: 2 m spacing is 29 km/h."""
DETOUR_SEED = 7919
"""Added to a street's seed for the street that a detour leads through."""


class SimulatedDrive(Sequence[ImageArray]):
    """One drive along a street; a lazy sequence of frames, uint8 (height, width, 3) RGB.

    Parameters
    ----------
    street : Street
    motion : Motion
        Where each frame is.
    disturbances : Disturbances
        How the drive looks. Its fields about motion are not read here: `motion` has them.
    camera : Camera
    seed : int
        Draws traffic, vibration, noise and rain.

    Notes
    -----
    A slice is a drive again, of the same frames with the same pixels.
    """

    def __init__(
        self, street: Street, motion: Motion, disturbances: Disturbances | None = None, *,
        camera: Camera | None = None, seed: int = 0,
    ) -> None:  # fmt: skip
        self.street, self.motion, self.seed = street, motion, seed
        self.disturbances = disturbances or Disturbances()
        self.camera = camera or Camera()
        self._frames = np.arange(len(motion))
        self._shared = _Rendering(self.street, self.motion, self.disturbances, self.camera, seed)

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def name(self) -> str:
        """What reports and messages call the drive."""
        return f"simulated street, seed {self.street.seed}, drive {self.seed}"

    @property
    def positions_m(self) -> Metres:
        """Position along the route, float64 (N,); NaN off the route."""
        return self.motion.positions_m[self._frames]

    @property
    def on_route(self) -> BoolArray:
        """Whether each frame lies on the route, bool (N,)."""
        return self.motion.on_route[self._frames]

    @overload
    def __getitem__(self, item: int) -> ImageArray: ...
    @overload
    def __getitem__(self, item: slice) -> "SimulatedDrive": ...
    def __getitem__(self, item: int | slice) -> "ImageArray | SimulatedDrive":
        """Render frame `item`, or return the drive of a slice without rendering."""
        if isinstance(item, slice):
            part = object.__new__(SimulatedDrive)
            part.__dict__.update(self.__dict__, _frames=self._frames[item])
            return part
        return self._shared.render(int(self._frames[item]))

    def __iter__(self) -> Iterator[ImageArray]:
        for frame in self._frames:
            yield self._shared.render(int(frame))


_street = lru_cache(maxsize=8, typed=True)(make_street)
_painters: WeakValueDictionary[tuple[Street, Disturbances, Camera], Painter] = WeakValueDictionary()


def _painter(street: Street, disturbances: Disturbances, camera: Camera) -> Painter:
    """Return a painter, the same one for drives that look alike: its textures take seconds."""
    d = disturbances
    seen = Disturbances(season=d.season, night=d.night, fog=d.fog, rain=d.rain)
    key = (street, seen, camera)
    painter = _painters.get(key)
    if painter is None:
        _painters[key] = painter = Painter(street, make_look(seen), camera)
    return painter


@dataclass(frozen=True)
class _Rendering:
    """What all slices of a drive share."""

    street: Street
    motion: Motion
    disturbances: Disturbances
    camera: Camera
    seed: int

    @cached_property
    def painter(self) -> Painter:
        return _painter(self.street, self.disturbances, self.camera)

    @cached_property
    def detour_painter(self) -> Painter:
        """Paints the other street, where the drive is off the route."""
        length = max(20.0, float(self.motion.places_m[~self.motion.on_route].max()))
        street = _street(self.street.seed + DETOUR_SEED, length)
        return _painter(street, self.disturbances, self.camera)

    @cached_property
    def traffic(self) -> Traffic:
        amount = self.disturbances.traffic
        return Traffic(amount, self.seed, self.motion.places_m, FRAME_S)

    def render(self, frame: int) -> ImageArray:
        painter = self.painter if self.motion.on_route[frame] else self.detour_painter
        return painter.paint(self.view(painter.street, frame), self.traffic, frame, self.seed)

    def view(self, street: Street, frame: int) -> View:
        """Return where the camera is at a frame and where it looks."""
        position, shake = float(self.motion.places_m[frame]), self.disturbances.vibration
        rng = np.random.default_rng([self.seed, 110, frame])
        yaw, pitch = rng.normal(0, math.radians(0.75), 2) * shake
        weave = 0.3 * shake * math.sin(position / 11.0 + self.seed)
        lateral = LANE_M / 2 * (1.0 - self.disturbances.lateral_shift) + weave
        x, y, _ = street.line.points(position, lateral)[0]
        heading = float(street.line.heading_at(position)) + float(yaw)
        return View(self.camera, float(x), float(y), heading, position, lateral, float(pitch) * 0.6)


@dataclass(frozen=True)
class SimulatedRoute:
    """Two drives of one street: the reference (map) and the query, with their truth."""

    reference: SimulatedDrive
    query: SimulatedDrive

    def truth(self, radius_m: float = 5.0) -> tuple[IntArray, ...]:
        """Return the true matches of every query frame.

        Parameters
        ----------
        radius_m : float >= 0
            A reference frame within this distance along the route is a true match.

        Returns
        -------
        positives : tuple of int64 arrays, one per query frame
            Sorted reference indices; empty where the query is off the route.

        Raises
        ------
        ConfigError
            `radius_m` is negative or not a number.
        """
        if not (math.isfinite(radius_m) and radius_m >= 0):
            raise ConfigError(f"radius_m is {radius_m!r}; expected metres from 0")
        references = self.reference.positions_m
        return tuple(
            np.flatnonzero(np.abs(references - position) <= radius_m).astype(np.int64)
            for position in self.query.positions_m
        )


def simulate_route(
    seed: int = 0, n_frames: int = 120, *, query: Disturbances | None = None,
    reference: Disturbances | None = None, motion: MotionKind = "forward", spacing_m: float = 2.0,
    camera: Camera | None = None,
) -> SimulatedRoute:  # fmt: skip
    """Simulate a reference drive and a disturbed query drive of one street.

    Parameters
    ----------
    seed : int >= 0
        Draws the street and everything that happens on it.
    n_frames : int in [2, 50000]
        Frames of the reference where it is driven straight; the query's number follows from
        its motion. With no disturbances both have the same positions and the same pixels.
    query, reference : Disturbances, optional
        None at all by default.
    motion : {"forward", "backwards", "detour", "jump"}
        How the query drives; see `plan_motion`. The reference drives forward.
    spacing_m : float > 0
        Metres between frames at nominal speed.
    camera : Camera, optional
        320 x 240 by default.

    Returns
    -------
    SimulatedRoute
        Nothing is rendered before a frame is asked for.

    Raises
    ------
    ConfigError
        A value is out of range; the message names it.

    Examples
    --------
    >>> route = simulate_route(seed=1, n_frames=10, query=Disturbances(night=1.0))
    >>> route.query[3].shape, route.truth(radius_m=2.0)[3].tolist()
    ((240, 320, 3), [2, 3, 4])
    """
    if not (isinstance(n_frames, int | np.integer) and 2 <= n_frames <= 50000):
        raise ConfigError(f"n_frames is {n_frames!r}; expected an integer from 2 to 50000")
    if not (math.isfinite(spacing_m) and 0 < spacing_m <= 50):
        raise ConfigError(f"spacing_m is {spacing_m!r}; expected metres above 0, up to 50")
    length = n_frames * spacing_m
    street = _street(seed, max(length, 10.0))
    drives = []
    for number, (changes, kind) in enumerate(((reference, "forward"), (query, motion))):
        d = changes or Disturbances()
        drive_seed = 2 * seed + number
        profile = plan_motion(
            kind, length_m=length, spacing_m=spacing_m,
            speed_change=d.speed_change, stops=d.stops, revisits=d.revisits, seed=drive_seed,
        )  # fmt: skip
        frames = profile.frames(drive_seed)
        drives.append(SimulatedDrive(street, frames, d, camera=camera, seed=drive_seed))
    return SimulatedRoute(reference=drives[0], query=drives[1])
