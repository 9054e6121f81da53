"""SeqSLAM: straight trajectories of several speeds through locally enhanced differences."""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.kernels import BestTrajectories, best_trajectories
from retraverse.matching.matchers.registry import register
from retraverse.matching.matchers.straight import Lines, StraightMatcher
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import FloatArray, IntArray

__all__ = ["SeqSlam", "SeqSlamParameters"]


@dataclass(frozen=True)
class SeqSlamParameters:
    """The published program's, which are the paper's but for the window's place."""

    v_min: float = parameter(0.8, "slowest speed searched, map frames per query frame")
    v_max: float = parameter(1.2, "fastest speed searched")
    contrast_window: int = parameter(
        10, "R_window of the contrast enhancement: so many references around each, and itself"
    )
    exclusion_window: int = parameter(
        10, "so many references around the best are no candidates for the second best"
    )
    uniqueness: float = parameter(
        1.0, "“no match” where best / second best is above this; the demonstration takes 0.9"
    )
    index: Literal["slope_aware", "original"] = parameter(
        "slope_aware", "reference answered: the line's own middle, or start + ds/2 at any speed"
    )

    def __post_init__(self) -> None:
        check_range("v_min", self.v_min, 0, self.v_max, " (v_max)")
        check_range("v_max", self.v_max, self.v_min, 10)
        check_range("contrast_window", self.contrast_window, 2, 10_000)
        check_range("exclusion_window", self.exclusion_window, 0, 10_000)
        check_range("uniqueness", self.uniqueness, 0, 1)


@register(SeqSlamParameters)
class SeqSlam(StraightMatcher):
    """SeqSLAM as published, from any similarity matrix: its difference is minus the similarity.

    `sequence_length` is the paper's ds, made even by adding one; a window has ds + 1 frames and
    answers for the middle one. Lines start at every reference and pass ``floor(t * v)`` further
    ones by query frame t; speeds v are those at which a whole number of references is passed in
    ds frames (8 to 12 for ds = 10). Lines that leave the map count as infinitely bad.

    The original program answers start + ds/2 at any speed, which is off by up to
    ``|1 - v| * ds / 2`` frames; ``index="original"`` does so too.
    """

    name: ClassVar[str] = "seqslam"
    summary: ClassVar[str] = "Straight lines of speed 0.8 to 1.2 through enhanced differences"
    citation: ClassVar[str] = (
        "Milford, Wyeth, SeqSLAM: visual route-based navigation for sunny summer days and stormy "
        "winter nights, ICRA, 2012"
    )
    cost: ClassVar[str] = "O(Q R K) for each of 0.4 K + 1 speeds; one more matrix in memory"
    assumes: ClassVar[str] = "a steady speed of 0.8 to 1.2 times the map's within each window"
    parameters: SeqSlamParameters

    def __init__(self, parameters: SeqSlamParameters | None = None) -> None:
        super().__init__(parameters or SeqSlamParameters())

    def lines(self, sequence_length: int) -> Lines:
        """Return the lines from a start, one for each whole number of references passed."""
        ds = sequence_length + sequence_length % 2
        slowest = math.ceil(self.parameters.v_min * ds - 1e-9)
        fastest = math.floor(self.parameters.v_max * ds + 1e-9)
        if slowest > fastest:
            raise ConfigError(
                f"seqslam: no speed from {self.parameters.v_min:g} to {self.parameters.v_max:g} "
                f"passes a whole number of references in {ds} frames; expected a wider range"
            )
        passed = np.arange(slowest, fastest + 1)[:, None]
        return Lines(offsets=np.arange(ds + 1) * passed // ds, middle=ds // 2)

    def search(self, enhanced: FloatArray, lines: Lines) -> BestTrajectories:
        """Return the line of the least sum for every window."""
        radius = self.parameters.exclusion_window // 2
        return best_trajectories(enhanced, lines.offsets, radius=radius)

    def answers(self, found: BestTrajectories, lines: Lines) -> IntArray:
        """Return the middle of each line, or its start + ds/2."""
        if self.parameters.index == "original":
            return found.anchor + lines.middle
        passed: IntArray = lines.offsets[found.slope, lines.middle]
        return found.anchor + passed
