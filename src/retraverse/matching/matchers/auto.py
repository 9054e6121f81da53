"""The matcher that looks at the drive first and picks another one for it."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError
from retraverse.matching.checks import check_lengths_fit, checked_similarity
from retraverse.matching.matchers.base import Matcher, OnlineMatcher
from retraverse.matching.matchers.evidence import standardise
from retraverse.matching.matchers.hmm import Hmm, HmmParameters, ViterbiSearch
from retraverse.matching.matchers.mean import Mean
from retraverse.matching.matchers.registry import register
from retraverse.matching.matchers.seqslam import SeqSlam
from retraverse.matching.matchers.trails import whole
from retraverse.matching.matches import Matches
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import BoolArray, FloatArray, IntArray

__all__ = ["Auto", "AutoParameters", "SpeedProfile", "speed_profile"]

SHORTEST_STRETCH = 20
"""Speeds are read over at least so many frames: where the path is two frames off at each end, the
speed is then 0.2 off."""
STEADY_SPEEDS = 0.75, 1.25
"""Speeds that SeqSLAM looks for, and one frame in a stretch of 20 on either side."""
MAP_SPEED = 0.1
"""Median speeds this near to 1 are the map's: a window of 10 drifts by less than one frame."""


@dataclass(frozen=True)
class AutoParameters:
    """Where one reason gives way to the next."""

    least_known: float = parameter(
        0.3, "share of frames whose place must be known, else the mean is taken"
    )
    steady_share: float = parameter(
        0.8, "share of stretches at speeds of about 0.8 to 1.2 from which a drive is steady"
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
    def steady(self) -> float:
        """Share of stretches within SeqSLAM's speeds."""
        low, high = STEADY_SPEEDS
        return float(((self.speed >= low) & (self.speed <= high)).mean()) if len(self.speed) else 0

    @property
    def median(self) -> float:
        """Median speed; NaN where none is known."""
        return float(np.median(self.speed)) if len(self.speed) else float("nan")


@register(AutoParameters)
class Auto:
    """Picks mean, seqslam or hmm (Viterbi) from the drive's own speed profile, and says why.

    The profile is read off the likeliest path of a hidden Markov model through the whole matrix
    (`speed_profile`): no labels, no other drive. Where too few places are known the mean is taken,
    which asks least of a technique; where the drive leaves the map, hmm; at the map's own steady
    speed the mean; at another steady one seqslam; at any other hmm. The choice and its reason are
    the first of the matches' notes.
    """

    name: ClassVar[str] = "auto"
    summary: ClassVar[str] = "Picks mean, seqslam or hmm from the speed profile, and says why"
    citation: ClassVar[str] = (
        "Profile: Rabiner, A tutorial on hidden Markov models, Proceedings of the IEEE, 1989; "
        "the choice is retraverse's own"
    )
    cost: ClassVar[str] = "that of hmm with decode=viterbi, then that of the matcher picked"
    assumes: ClassVar[str] = "the whole drive to look at, and single frames that are mostly right"
    frame_by_frame: ClassVar[bool] = False

    def __init__(self, parameters: AutoParameters | None = None) -> None:
        self.parameters = parameters or AutoParameters()

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """See `Matcher.match`."""
        scores = checked_similarity(similarity)
        check_lengths_fit(scores.shape[0], scores.shape[1], sequence_length)
        chosen, reason = self.choose(speed_profile(scores, sequence_length))
        if isinstance(chosen, SeqSlam) and len(scores) < chosen.lines(sequence_length).n_rows:
            chosen, reason = Mean(), f"{reason}, but it is too short for seqslam"
        matches = chosen.match(scores, sequence_length)
        return replace(matches, notes=(f"auto picked {chosen.name}: {reason}.", *matches.notes))

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """Raise `ConfigError`: the profile is known when the drive has ended."""
        raise ConfigError("auto needs the whole drive; expected mean, seqslam, hmm or graph")

    def choose(self, profile: SpeedProfile) -> tuple[Matcher, str]:
        """Return the matcher for a profile, and why."""
        limits = self.parameters
        if profile.known < limits.least_known or not len(profile.speed):
            return Mean(), (
                f"the places of only {profile.known:.0%} of the frames are clear enough to read a "
                "speed from"
            )
        if profile.absent > limits.absent_share:
            return _any_speed(), f"the drive is off the map for {profile.absent:.0%} of its frames"
        if profile.steady < limits.steady_share:
            return _any_speed(), (
                f"the speed changes: only {profile.steady:.0%} of the stretches run at about "
                "0.8 to 1.2 times the map's"
            )
        if abs(profile.median - 1) > MAP_SPEED:
            return SeqSlam(), f"the speed is a steady {profile.median:.2f} times the map's"
        return Mean(), f"the speed is the map's ({profile.median:.2f} times)"


def speed_profile(similarity: FloatArray, sequence_length: int) -> SpeedProfile:
    """Return how a drive moves over the map.

    Parameters
    ----------
    similarity : float32 array, shape (Q, R)
        Rows are queries; finite.
    sequence_length : int
        K: a stretch is K frames, but at least 20 (or the whole drive).
    """
    evidence = standardise(similarity)
    path, _ = whole(ViterbiSearch(Hmm(HmmParameters())).advance(evidence), evidence, 1)
    stretch = min(max(sequence_length, SHORTEST_STRETCH), len(path))
    return SpeedProfile(
        speed=_speeds(path, stretch),
        known=float((path >= 0).mean()),
        absent=_absent_share(path < 0, 2 * stretch),
    )


def _any_speed() -> Hmm:
    return Hmm(HmmParameters(decode="viterbi"))


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
