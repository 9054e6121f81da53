"""Where the camera is at every frame: legs of a route, driven at a changing speed, with stops.

A `MotionProfile` is a list of legs and how they are driven. `plan_motion` makes the usual
ones by name; any other is made from legs of one's own.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from retraverse.datasets.simulated.path import Metres
from retraverse.errors import ConfigError
from retraverse.types import BoolArray

__all__ = ["Leg", "Motion", "MotionKind", "MotionProfile", "plan_motion"]

MotionKind = Literal["forward", "backwards", "detour", "jump"]
KINDS: tuple[MotionKind, ...] = ("forward", "backwards", "detour", "jump")


@dataclass(frozen=True)
class Leg:
    """A piece of road driven from `start_m` to `end_m`; backwards where the end is less.

    The camera always faces forward along the street: a leg driven backwards is seen as in a
    film played in reverse.
    """

    start_m: float
    end_m: float
    on_route: bool = True
    """False: these metres are of another street, one that the reference never saw."""


@dataclass(frozen=True)
class Motion:
    """Where the camera is at every frame."""

    places_m: Metres
    """Metres along the street of each frame: the route, or the other street, float64 (N,)."""
    on_route: BoolArray
    """Whether the frame lies on the route, bool (N,)."""

    def __len__(self) -> int:
        return len(self.places_m)

    @property
    def positions_m(self) -> Metres:
        """Position along the route of each frame, float64 (N,); NaN off the route."""
        return np.where(self.on_route, self.places_m, np.nan)


@dataclass(frozen=True)
class MotionProfile:
    """Legs, and how they are driven.

    Raises
    ------
    ConfigError
        No legs, a spacing that is not positive, or a value outside 0..1.
    """

    legs: tuple[Leg, ...]
    """Driven one after the other; between them the camera is simply somewhere else."""
    spacing_m: float = 2.0
    """Metres between frames at nominal speed."""
    speed_change: float = 0.0
    """0 constant; at 1 the speed swings smoothly between half and twice the nominal one."""
    stops: float = 0.0
    """0 none; at 1 half as many frames again stand still as move: one in three of all."""

    def __post_init__(self) -> None:
        if not self.legs:
            raise ConfigError("motion profile has no legs; expected at least one Leg")
        if not (math.isfinite(self.spacing_m) and self.spacing_m > 0):
            raise ConfigError(f"spacing_m is {self.spacing_m!r}; expected metres above 0")
        for name in ("speed_change", "stops"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} is {getattr(self, name)!r}; expected 0 to 1")

    def frames(self, seed: int = 0) -> Motion:
        """Return the position of every frame.

        Parameters
        ----------
        seed : int
            Draws when the speed changes and where the stops are.

        Returns
        -------
        Motion
            The first frame is at the start of the first leg. Neighbouring frames of a leg lie
            `spacing_m` times a factor in [2**-speed_change, 2**speed_change] apart, or nowhere
            apart in a stop.
        """
        driven = self._driven(np.random.default_rng([seed, 100]))
        driven = self._with_stops(driven, np.random.default_rng([seed, 101]))
        ends = np.cumsum([abs(leg.end_m - leg.start_m) for leg in self.legs])
        which = np.minimum(np.searchsorted(ends, driven, side="right"), len(self.legs) - 1)
        begins = np.concatenate([[0.0], ends[:-1]])
        starts = np.array([leg.start_m for leg in self.legs])
        signs = np.array([math.copysign(1.0, leg.end_m - leg.start_m) for leg in self.legs])
        places = starts[which] + signs[which] * (driven - begins[which])
        on_route = np.array([leg.on_route for leg in self.legs])
        return Motion(places_m=places, on_route=on_route[which])

    def _driven(self, rng: np.random.Generator) -> Metres:
        """Return the metres driven until each frame, without stops."""
        total = sum(abs(leg.end_m - leg.start_m) for leg in self.legs)
        count = max(1, math.ceil(total / self.spacing_m * 2.0**self.speed_change - 1e-9))
        if self.speed_change == 0:
            return np.arange(count) * self.spacing_m
        phases, periods = rng.uniform(0, 2 * np.pi, 2), rng.uniform(0.8, 1.25, 2) * (46.0, 19.0)
        time = np.arange(count - 1 if count > 1 else 1)
        swing = 0.68 * np.sin(2 * np.pi * time / periods[0] + phases[0])
        swing += 0.32 * np.sin(2 * np.pi * time / periods[1] + phases[1])
        steps = self.spacing_m * 2.0 ** (self.speed_change * swing)
        driven = np.concatenate([[0.0], np.cumsum(steps)])
        return driven[driven < total]

    def _with_stops(self, driven: Metres, rng: np.random.Generator) -> Metres:
        """Return the metres driven with frames repeated where the camera stands."""
        standing = round(0.5 * self.stops * len(driven))
        if standing == 0:
            return driven
        count = max(1, round(standing / 9))
        places = np.sort(rng.choice(len(driven), min(count, len(driven)), replace=False))
        repeats = np.ones(len(driven), int)
        shares = rng.dirichlet(np.full(len(places), 4.0)) * standing
        edges = np.round(np.cumsum(shares)).astype(int)
        repeats[places] += np.diff(np.concatenate([[0], edges]))
        return np.repeat(driven, repeats)


def plan_motion(
    kind: MotionKind = "forward", *, length_m: float, spacing_m: float = 2.0,
    speed_change: float = 0.0, stops: float = 0.0, revisits: float = 0.0, seed: int = 0,
) -> MotionProfile:  # fmt: skip
    """Return a motion profile over a route from 0 to `length_m`.

    Parameters
    ----------
    kind : {"forward", "backwards", "detour", "jump"}
        ``detour`` leaves the route after about 40 %, drives a quarter of its length through
        another street, and comes back about 15 % further on. ``jump`` is the kidnapped robot:
        from about 35 % straight to about 70 %, and at the end back to 35 % for the part left
        out.
    length_m, spacing_m : float > 0
    speed_change, stops : float in [0, 1]
        As in `MotionProfile`.
    revisits : float in [0, 1]
        At 1 half of the route is driven a second time, in two returns.
    seed : int
        Shifts where it leaves, jumps and returns.

    Raises
    ------
    ConfigError
        Unknown `kind`, or a value out of range.
    """
    if kind not in KINDS:
        raise ConfigError(f"motion kind is {kind!r}; expected one of {', '.join(KINDS)}")
    if not (math.isfinite(length_m) and length_m > 0):
        raise ConfigError(f"motion length_m is {length_m!r}; expected metres above 0")
    if not 0.0 <= revisits <= 1.0:
        raise ConfigError(f"revisits is {revisits!r}; expected 0 to 1")
    shift = float(np.random.default_rng([seed, 102]).uniform(-0.05, 0.05))
    parts = {
        "forward": [Leg(0.0, 1.0)],
        "backwards": [Leg(1.0, 0.0)],
        "detour": [Leg(0.0, 0.4 + shift), Leg(0.0, 0.25, on_route=False), Leg(0.55 + shift, 1.0)],
        "jump": [Leg(0.0, 0.35 + shift), Leg(0.7 + shift, 1.0), Leg(0.35 + shift, 0.7 + shift)],
    }[kind]
    legs = _with_returns(parts, revisits, seed) if revisits > 0 else parts
    return MotionProfile(
        tuple(Leg(leg.start_m * length_m, leg.end_m * length_m, leg.on_route) for leg in legs),
        spacing_m, speed_change, stops,
    )  # fmt: skip


def _with_returns(legs: list[Leg], revisits: float, seed: int) -> list[Leg]:
    """Return the legs with the longest one driven with two returns to earlier places."""
    longest = max(range(len(legs)), key=lambda i: abs(legs[i].end_m - legs[i].start_m))
    leg = legs[longest]
    run = leg.end_m - leg.start_m
    back = 0.25 * revisits * run
    rng = np.random.default_rng([seed, 103])
    first, second = sorted(rng.uniform(0.3, 0.98, 2))
    a, b = (leg.start_m + float(part) * run for part in (first, second))
    returns = [Leg(leg.start_m, a), Leg(a - back, b), Leg(b - back, leg.end_m)]
    return [*legs[:longest], *returns, *legs[longest + 1 :]]
