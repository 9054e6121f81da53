"""A recorded drive driven again at another speed: stops, haste, reverse, detours and jumps.

A profile says how; a seed says where. Each frame of the new drive is the nearest recorded frame to
where the camera would be, so real pictures stay real. The speeds and stops are those of the
simulator (`retraverse.datasets.simulated.motion`), in frames instead of metres.

Leaving the map: a recorded line has no other street, so a detour drives through a stretch of the
line that the *map* must then do without; `Resampling.map_frames` says which frames it keeps.

Contents: `SpeedProfile`, `PROFILES`, `Resampling`, `plan_resampling`, `resample`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.simulated.motion import Leg, MotionKind, MotionProfile
from retraverse.errors import ConfigError, InputError
from retraverse.images import Traverse
from retraverse.types import BoolArray, IntArray

__all__ = ["PROFILES", "Resampling", "SpeedProfile", "plan_resampling", "resample"]

FEWEST_FRAMES = 10
"""A recorded drive of fewer frames has no parts to jump between."""


@dataclass(frozen=True)
class SpeedProfile:
    """How a recorded drive is driven again.

    Raises
    ------
    ConfigError
        If `speed_change` or `stops` is outside 0..1.
    """

    kind: MotionKind = "forward"
    """``forward``, ``backwards``, ``detour`` (a fifth of the drive, from about 40 %, is not on the
    map) or ``jump`` (from about 35 % to 70 %, and at the end back for the part left out)."""
    speed_change: float = 0.0
    """0: the map's speed; at 1 the speed swings between half and twice the map's."""
    stops: float = 0.0
    """0: none; at 1 one frame in three stands still."""

    def __post_init__(self) -> None:
        if self.kind not in get_args(MotionKind):
            kinds = ", ".join(get_args(MotionKind))
            raise ConfigError(f"speed profile kind: got {self.kind!r}, expected one of {kinds}")
        for name in ("speed_change", "stops"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name}: got {getattr(self, name)!r}, expected 0 to 1")


PROFILES: Mapping[str, SpeedProfile] = MappingProxyType(
    {
        "constant": SpeedProfile(),
        "varying": SpeedProfile(speed_change=1.0),
        "stops": SpeedProfile(stops=1.0),
        "backwards": SpeedProfile("backwards"),
        "detour": SpeedProfile("detour"),
        "jump": SpeedProfile("jump"),
    }
)
"""The profiles that have a name."""


@dataclass(frozen=True, eq=False)
class Resampling:
    """Which recorded frame each frame of the new drive shows."""

    places: NDArray[np.float64]
    """(Q,) where the camera is, in frames of the recorded drive."""
    frames: IntArray
    """(Q,) the recorded frame nearest to that."""
    off_map: IntArray
    """Recorded frames of the stretch that the map does without, rising; empty: none."""
    n_frames: int
    """Frames of the recorded drive."""
    profile: SpeedProfile
    seed: int

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def on_map(self) -> BoolArray:
        """Whether each frame lies where the map has frames, bool (Q,)."""
        return np.asarray(~np.isin(self.frames, self.off_map))

    def map_frames(self, truth: GroundTruth) -> IntArray:
        """Return the references that the map keeps: all but those that show the stretch left out.

        Parameters
        ----------
        truth : GroundTruth
            Of all recorded frames against the whole map.

        Raises
        ------
        InputError
            If it is the truth of another drive, or does not say how many references there are.
        """
        self._check(truth)
        if truth.n_references is None:
            raise InputError(f"{truth.description}: say n_references, the source does not")
        kept = np.ones(truth.n_references, np.bool_)
        for frame in self.off_map:
            kept[truth.positives[frame]] = False
        return np.flatnonzero(kept)

    def truth(self, truth: GroundTruth) -> GroundTruth:
        """Return the truth of the new drive on the map that is left.

        The tolerance stays that of the recorded frames: a frame of the new drive has the positives
        of the recorded frame it shows.

        Parameters and errors as in `map_frames`.
        """
        self._check(truth)
        note = f"; driven again ({_text(self.profile)}, seed {self.seed})"
        driven = replace(
            truth,
            positives=tuple(truth.positives[frame] for frame in self.frames),
            description=truth.description + note,
        )
        if not len(self.off_map):
            return driven
        return driven.select(None, self.map_frames(truth))

    def _check(self, truth: GroundTruth) -> None:
        if truth.n_queries != self.n_frames:
            raise InputError(
                f"ground truth: got {truth.n_queries} queries, expected {self.n_frames}: one per "
                "frame of the recorded drive, before it is resampled"
            )


def resample(
    traverse: Traverse,
    profile: str | SpeedProfile = "varying",
    *,
    spacing: float = 1.0,
    seed: int = 0,
) -> tuple[Traverse, Resampling]:
    """Return a recorded traverse driven again at another speed, and which frames it shows.

    Parameters
    ----------
    traverse : Traverse
        The recorded drive, unthinned if possible: nearest frames then lie closer.
    profile, spacing, seed
        As in `plan_resampling`.

    Returns
    -------
    driven : Traverse
        Its frames keep their `index`; one that the camera stands at comes several times.
    resampling : Resampling
        Makes the truth of the new drive.

    Raises
    ------
    ConfigError, InputError
        As in `plan_resampling`.

    Examples
    --------
    >>> from retraverse.images import open_traverse
    >>> drive = open_traverse([np.full((8, 8), i, np.uint8) for i in range(20)])
    >>> driven, resampling = resample(drive, "backwards")
    >>> driven[0].index, driven[19].index
    (19, 0)
    """
    resampling = plan_resampling(len(traverse), profile, spacing=spacing, seed=seed)
    driven = traverse.take(resampling.frames)
    source = f"{traverse.source}, driven again ({_text(resampling.profile)}, seed {seed})"
    return replace(driven, source=source), resampling


def plan_resampling(
    n_frames: int,
    profile: str | SpeedProfile = "varying",
    *,
    spacing: float = 1.0,
    seed: int = 0,
) -> Resampling:
    """Return which frames of a drive of `n_frames` are seen when it is driven again.

    Parameters
    ----------
    n_frames : int of at least 10
        Frames of the recorded drive.
    profile : SpeedProfile, or a name of `PROFILES`
    spacing : float above 0
        Recorded frames from one frame to the next at the map's speed: 20 where the map has every
        20th frame.
    seed : int
        Draws when the speed changes, where the stops are, where it leaves the map or jumps.

    Raises
    ------
    ConfigError
        If the profile is unknown or `spacing` is not above 0.
    InputError
        If there are fewer than 10 frames.
    """
    if isinstance(profile, str) and profile not in PROFILES:
        raise ConfigError(f"unknown speed profile: got {profile!r}, expected {', '.join(PROFILES)}")
    if n_frames < FEWEST_FRAMES:
        raise InputError(
            f"resample: got a drive of {n_frames} frames, expected at least {FEWEST_FRAMES}"
        )
    driven = PROFILES[profile] if isinstance(profile, str) else profile
    legs = _legs(driven.kind, n_frames, seed)
    motion = MotionProfile(legs, spacing, driven.speed_change, driven.stops).frames(seed)
    frames = np.clip(np.rint(motion.places_m), 0, n_frames - 1).astype(np.int64)
    stretches = [np.arange(leg.start_m, leg.end_m) for leg in legs if not leg.on_route]
    off_map = np.concatenate([np.empty(0), *stretches]).astype(np.int64)
    return Resampling(motion.places_m, frames, off_map, n_frames, driven, seed)


def _legs(kind: MotionKind, n_frames: int, seed: int) -> tuple[Leg, ...]:
    """Return the legs in frames; `Leg` calls them metres.

    Not those of `plan_motion`: a recorded drive ends with its last frame, and its detour is on it.
    """
    shift = float(np.random.default_rng([seed, 104]).uniform(-0.05, 0.05))

    def at(part: float) -> float:
        return float(round((part + shift) * n_frames))

    if kind == "backwards":
        return (Leg(n_frames - 1.0, -1.0),)
    if kind == "detour":
        return (
            Leg(0.0, at(0.4)),
            Leg(at(0.4), at(0.6), on_route=False),
            Leg(at(0.6), float(n_frames)),
        )
    if kind == "jump":
        return Leg(0.0, at(0.35)), Leg(at(0.7), float(n_frames)), Leg(at(0.35), at(0.7))
    return (Leg(0.0, float(n_frames)),)


def _text(profile: SpeedProfile) -> str:
    """Return the profile in words: ``forward, speed_change 1``."""
    changes = [
        f"{name} {getattr(profile, name):g}"
        for name in ("speed_change", "stops")
        if getattr(profile, name)
    ]
    return ", ".join([profile.kind, *changes])
