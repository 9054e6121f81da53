"""The matcher that looks at the drive first and picks another one for it."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError
from retraverse.matching.checks import check_lengths_fit, checked_similarity
from retraverse.matching.matchers.balanced import Balanced, BalancedParameters
from retraverse.matching.matchers.base import Matcher, OnlineMatcher
from retraverse.matching.matchers.hmm import Hmm, HmmParameters
from retraverse.matching.matchers.registry import register
from retraverse.matching.matches import Matches
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import BoolArray, FloatArray, IntArray

__all__ = ["Auto", "AutoParameters", "SpeedProfile", "speed_profile"]

SHORTEST_STRETCH = 20
"""Speeds are read over at least so many frames: where the path is two frames off at each end, the
speed is then 0.2 off."""
STEADY = 0.25
"""A stretch this near to the median speed runs at it: one frame in a stretch of 20 on either side,
and the fifth by which SeqSLAM's speeds differ."""


@dataclass(frozen=True)
class AutoParameters:
    """Where one reason gives way to the next."""

    least_known: float = parameter(
        0.3, "share of frames whose place must be known, else the balanced mean is taken"
    )
    steady_share: float = parameter(
        0.8, "share of stretches near the median speed from which a drive is steady"
    )
    absent_share: float = parameter(
        0.05, "share of frames in long absences from which a drive leaves the map"
    )

    def __post_init__(self) -> None:
        for name in ("least_known", "steady_share", "absent_share"):
            check_range(name, getattr(self, name), 0, 1)


@dataclass(frozen=True)
class SpeedProfile:
    """How a drive moves over the map, as its likeliest path says."""

    speed: NDArray[np.float64]
    """(V,) map frames per query frame over every stretch between the first and the last frame
    whose place is known; across frames of unknown place the drive is taken to go on evenly."""
    known: float
    """Share of frames whose place is known, in [0, 1]."""
    absent: float
    """Share of frames in long absences: of at least two stretches, in a drive whose places are
    known nearly everywhere else. Where they are not, the technique is weak, and absences say
    nothing."""

    @property
    def median(self) -> float:
        """Median speed; NaN where none is known."""
        return float(np.median(self.speed)) if len(self.speed) else float("nan")

    @property
    def steady(self) -> float:
        """Share of stretches at about the median speed; 0 where no speed is known."""
        return float((np.abs(self.speed - self.median) <= STEADY).mean()) if len(self.speed) else 0


@register(AutoParameters)
class Auto:
    """Picks hmm (Viterbi) or the balanced mean by how the drive moves, and says why.

    The speed profile is read off the likeliest path of a hidden Markov model through the whole
    matrix (`speed_profile`): no labels, no other drive. Where the places of enough frames are
    clear, that path is also the answer, at whatever speed the drive goes: on real drives it was
    right more often than windows along diagonals even at the map's own speed (docs: matching).
    Where they are not, a path may wander, and the balanced mean is taken, which asks least of a
    technique. The choice and its reason are the first of the matches' notes.
    """

    name: ClassVar[str] = "auto"
    summary: ClassVar[str] = "Picks hmm or the balanced mean by how the drive moves, and says why"
    citation: ClassVar[str] = (
        "Profile: Rabiner, A tutorial on hidden Markov models, Proceedings of the IEEE, 1989; "
        "the choice is retraverse's own"
    )
    cost: ClassVar[str] = "that of hmm with decode=viterbi, and balanced's where that is picked"
    assumes: ClassVar[str] = "the whole drive to look at"
    frame_by_frame: ClassVar[bool] = False

    def __init__(self, parameters: AutoParameters | None = None) -> None:
        self.parameters = parameters or AutoParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        check_lengths_fit(scores.shape[0], scores.shape[1], sequence_length)
        path = Hmm(HmmParameters(decode="viterbi")).match(scores, sequence_length)
        profile = speed_profile(path.reference, sequence_length)
        unclear = self.why_unclear(profile)
        if unclear:
            other: Matcher = Balanced(BalancedParameters(over="drive"))
            matches, name, reason = other.match(scores, sequence_length), other.name, unclear
        else:
            matches, name, reason = path, Hmm.name, self.describe(profile)
        return replace(matches, notes=(f"auto picked {name}: {reason}.", *matches.notes))

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """Raise `ConfigError`: the profile is known when the drive has ended."""
        raise ConfigError("auto needs the whole drive; expected mean, seqslam, hmm or graph")

    def why_unclear(self, profile: SpeedProfile) -> str:
        """Return why the path is not to be trusted, or nothing."""
        if profile.known >= self.parameters.least_known and len(profile.speed):
            return ""
        return (
            f"the places of only {profile.known:.0%} of the frames are clear enough to read a "
            "speed from"
        )

    def describe(self, profile: SpeedProfile) -> str:
        """Return how the drive moves, in words."""
        if profile.absent > self.parameters.absent_share:
            return f"the drive is off the map for {profile.absent:.0%} of its frames"
        if profile.steady < self.parameters.steady_share:
            low, high = np.quantile(profile.speed, (0.1, 0.9))
            return f"the speed changes: mostly {low:.1f} to {high:.1f} times the map's"
        return f"the speed is a steady {profile.median:.2f} times the map's"


def speed_profile(path: IntArray, sequence_length: int) -> SpeedProfile:
    """Return how a drive moves over the map.

    Parameters
    ----------
    path : int array, shape (Q,)
        Each query frame's reference on the likeliest path, -1 = none.
    sequence_length : int
        K: a stretch is K frames, but at least 20 (or the whole drive).
    """
    stretch = min(max(sequence_length, SHORTEST_STRETCH), len(path))
    return SpeedProfile(
        speed=_speeds(path, stretch),
        known=float((path >= 0).mean()),
        absent=_absent_share(path < 0, 2 * stretch),
    )


def _speeds(path: IntArray, stretch: int) -> NDArray[np.float64]:
    """Return the mean speed of every stretch between the first and last known place."""
    known = np.flatnonzero(path >= 0)
    if len(known) < 2 or stretch < 2:
        return np.zeros(0)
    frames = np.arange(known[0], known[-1] + 1)
    place = np.interp(frames, known, path[known])
    n_stretches = max(0, len(place) - stretch + 1)
    return np.asarray((place[stretch - 1 :] - place[:n_stretches]) / (stretch - 1))


def _absent_share(unknown: BoolArray, shortest: int) -> float:
    """Return the share of frames in runs of unknown place, if the others are known densely."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], unknown.astype(np.int8), [0]])))
    starts, ends = edges[::2], edges[1::2]
    long = ends - starts >= shortest
    n_absent = int((ends - starts)[long].sum())
    n_elsewhere = len(unknown) - n_absent
    n_unknown_elsewhere = int(unknown.sum()) - n_absent
    if n_elsewhere == 0 or n_unknown_elsewhere > 0.1 * n_elsewhere:
        return 0.0
    return n_absent / len(unknown)
