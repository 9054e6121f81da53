"""What moves: cars ahead and oncoming, people on the pavements, cars parked since.

Everything follows from the drive's seed and the time alone, so a frame never depends on which
frames were rendered before. Movers are placed by when the camera meets them, so that there is
as much traffic at the end of a long route as at its start.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from retraverse.datasets.simulated.path import Metres
from retraverse.datasets.simulated.street import FRONT_M, KERB_M, LANE_M
from retraverse.datasets.simulated.things import ParkedCar

__all__ = ["Mover", "Traffic"]

ONCOMING_S, LEADER_S, WALKER_M = 2.0, 9.0, 6.0
"""Seconds between oncoming cars, seconds a car stays ahead, metres between walkers."""


@dataclass(frozen=True)
class Mover:
    """A car or a person at one instant."""

    kind: Literal["car", "person"]
    seed: int
    key_m: float
    lateral_m: float
    is_oncoming: bool
    phase: float = 0.0
    """Of a person's stride, radians."""


class Traffic:
    """Traffic of one drive.

    Parameters
    ----------
    amount : float in [0, 1]
        Part of the slots for cars and people that are taken.
    seed : int
    positions_m : float64 (N,)
        Where the camera is at each frame.
    frame_s : float
        Seconds between frames.
    """

    def __init__(self, amount: float, seed: int, positions_m: Metres, frame_s: float) -> None:
        self.amount, self.seed = amount, seed
        self._positions, self._frame_s = positions_m, frame_s
        self._frames = np.arange(len(positions_m), dtype=float)
        self.parked_body = lru_cache(maxsize=4096)(self._parked_body)

    def movers(self, frame: int) -> list[Mover]:
        """Return everything that moves near the camera at a frame."""
        if self.amount <= 0:
            return []
        now = frame * self._frame_s
        here = float(self._positions[frame])
        return [*self._oncoming(now, here), *self._leader(now, here), *self._walkers(now, here)]

    def _parked_body(self, car: ParkedCar) -> int | None:
        """Return the seed of the vehicle at a kerbside place, or None if it is empty."""
        rng = np.random.default_rng([self.seed, 80, car.seed])
        if rng.random() >= 0.6 * self.amount:
            return car.seed if car.is_taken else None
        return int(rng.integers(2**31)) if rng.random() < 0.5 else None

    def _camera_at(self, time: float) -> float:
        return float(np.interp(time / self._frame_s, self._frames, self._positions))

    def _oncoming(self, now: float, here: float) -> Iterator[Mover]:
        for k in range(math.floor(now / ONCOMING_S) - 4, math.floor(now / ONCOMING_S) + 9):
            rng = np.random.default_rng([self.seed, 81, k + 1000])
            if rng.random() < 0.9 * self.amount:
                meets = (k + float(rng.uniform(0.1, 0.6))) * ONCOMING_S
                s = self._camera_at(meets) + 9.0 * (meets - now)
                if -8 < s - here < 150:
                    lateral = -LANE_M / 2 + float(rng.normal(0, 0.12))
                    yield Mover("car", int(rng.integers(2**31)), s, lateral, True)

    def _leader(self, now: float, here: float) -> Iterator[Mover]:
        """Yield the car ahead: it comes from afar, stays close, and draws away again."""
        slot = math.floor(now / LEADER_S)
        rng = np.random.default_rng([self.seed, 82, slot + 1000])
        if rng.random() < 0.85 * self.amount:
            part = now / LEADER_S - slot
            nearest = float(rng.uniform(7.5, 14))
            gap = nearest + 75 * (1 - math.sin(math.pi * part)) ** 1.6
            yield Mover("car", int(rng.integers(2**31)), here + gap, LANE_M / 2, False)

    def _walkers(self, now: float, here: float) -> Iterator[Mover]:
        for k in range(math.floor((here - 16) / WALKER_M), math.floor((here + 70) / WALKER_M)):
            for side in (-1, 1):
                rng = np.random.default_rng([self.seed, 83, side + 1, k + 1000])
                if rng.random() < 0.75 * self.amount:
                    home = (k + float(rng.random())) * WALKER_M
                    speed = float(rng.choice([-1, 1]) * rng.uniform(0.9, 1.6))
                    passing = int(np.argmin(np.abs(self._positions - home))) * self._frame_s
                    s = home + speed * float(np.clip(now - passing, -12, 12))
                    lateral = side * float(rng.uniform(KERB_M + 0.7, FRONT_M - 0.5))
                    seed = int(rng.integers(2**31))
                    yield Mover("person", seed, s, lateral, speed < 0, 4.5 * now + home)
