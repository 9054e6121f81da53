"""OpenSeqSLAM2's three searches: trajectory, cone and hybrid."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse.kernels import BestTrajectories, best_trajectories
from retraverse.matching.matchers.registry import register
from retraverse.matching.matchers.straight import Lines, StraightMatcher
from retraverse.techniques.parameters import check_range, parameter
from retraverse.types import Array, FloatArray, IntArray

__all__ = ["OpenSeqSlam2", "OpenSeqSlam2Parameters"]

BLOCK_WINDOWS = 128
"""Windows searched at once by cone and hybrid; bounds their memory."""


@dataclass(frozen=True)
class OpenSeqSlam2Parameters:
    """The program's default settings; its default sequence length is 15."""

    search: Literal["trajectory", "cone", "hybrid"] = parameter(
        "trajectory",
        "the line of the least sum; the cone that most frames' best references fall into; or the "
        "best of the lines through some frame's best reference",
    )
    v_min: float = parameter(0.8, "slowest speed searched, map frames per query frame")
    v_max: float = parameter(1.2, "fastest speed searched")
    v_step: float = parameter(0.1, "from speed to speed; speeds snap to whole references")
    contrast_window: int = parameter(10, "so many references around each, and itself")
    exclusion_window: int = parameter(
        10, "so many references around the best are no candidates for the second best"
    )
    uniqueness: float = parameter(
        1.0, "“no match” where best / second best is above this; the program takes 0.9"
    )

    def __post_init__(self) -> None:
        check_range("v_min", self.v_min, 0, self.v_max, " (v_max)")
        check_range("v_max", self.v_max, self.v_min, 10)
        check_range("v_step", self.v_step, 1e-3, 10)
        check_range("contrast_window", self.contrast_window, 2, 10_000)
        check_range("exclusion_window", self.exclusion_window, 0, 10_000)
        check_range("uniqueness", self.uniqueness, 0, 1)


@register(OpenSeqSlam2Parameters)
class OpenSeqSlam2(StraightMatcher):
    """SeqSLAM as its second program does it: lines through the window's middle.

    `sequence_length` is ds: a window has ds frames and answers for frame ds // 2 of it. Lines turn
    about the reference there; speeds snap to whole references per ds // 2 frames, steps round half
    away from zero, and lines that leave the map are dropped.

    ``"cone"`` asks how many of the window's frames have their best reference between the slowest
    and the fastest line; the distance is 1 - that share. ``"hybrid"`` takes the least sum among the
    lines that pass through the best reference of at least one frame.
    """

    name: ClassVar[str] = "openseqslam2"
    summary: ClassVar[str] = "SeqSLAM's lines about the middle; or its cone or hybrid search"
    citation: ClassVar[str] = (
        "Talbot, Garg, Milford, OpenSeqSLAM2.0: an open source toolbox for visual place "
        "recognition under changing conditions, IROS, 2018"
    )
    cost: ClassVar[str] = "O(Q R K) for each speed; cone O(Q R); one more matrix in memory"
    assumes: ClassVar[str] = "a steady speed of 0.8 to 1.2 times the map's within each window"
    parameters: OpenSeqSlam2Parameters

    def __init__(self, parameters: OpenSeqSlam2Parameters | None = None) -> None:
        super().__init__(parameters or OpenSeqSlam2Parameters())

    def lines(self, sequence_length: int) -> Lines:
        """Return the distinct lines about the middle, slowest first."""
        half = sequence_length // 2
        steps = np.arange(sequence_length) - half
        n_speeds = round((self.parameters.v_max - self.parameters.v_min) / self.parameters.v_step)
        speeds = self.parameters.v_min + self.parameters.v_step * np.arange(n_speeds + 1)
        passed = np.unique(_round_away(speeds * half)) if half else np.zeros(1, np.int64)
        offsets = _round_away(passed[:, None] * steps / max(half, 1))
        return Lines(offsets=np.ascontiguousarray(offsets), middle=half)

    def search(self, enhanced: FloatArray, lines: Lines) -> BestTrajectories:
        """Return the best line, or the best cone, of every window."""
        radius = self.parameters.exclusion_window // 2
        if self.parameters.search == "trajectory":
            return best_trajectories(enhanced, lines.offsets, radius=radius)
        search = _cone if self.parameters.search == "cone" else _hybrid
        n_windows = len(enhanced) - lines.n_rows + 1
        parts = [
            search(enhanced[start : start + BLOCK_WINDOWS + lines.n_rows - 1], lines, radius)
            for start in range(0, n_windows, BLOCK_WINDOWS)
        ]
        return BestTrajectories(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def distances(self, sums: FloatArray, lines: Lines, least: float) -> FloatArray:
        """Return sums along lines as distances from 0; a cone's are already."""
        return sums if self.parameters.search == "cone" else super().distances(sums, lines, least)

    def answers(self, found: BestTrajectories, lines: Lines) -> IntArray:
        """Return the reference in the middle: the line's anchor."""
        return found.anchor


def _cone(enhanced: FloatArray, lines: Lines, radius: int) -> BestTrajectories:
    """Return the cone with the most frames' best references in it, for every window."""
    n_windows, n = len(enhanced) - lines.n_rows + 1, enhanced.shape[1]
    best_reference = enhanced.argmin(axis=1)
    slowest, fastest = lines.offsets.min(axis=0), lines.offsets.max(axis=0)
    windows = np.arange(n_windows)
    # Each frame's best reference lies in the cones of a run of middles: +1 where the run begins,
    # -1 after its end, and a running sum counts the hits.
    edges = np.zeros((n_windows, n + 1), np.int32)
    for t in range(lines.n_rows):
        best = best_reference[t : t + n_windows]
        edges[windows, np.clip(best - fastest[t], 0, n)] += 1
        edges[windows, np.clip(best - slowest[t] + 1, 0, n)] -= 1
    hits = np.cumsum(edges[:, :n], axis=1)
    distance = (1 - hits / lines.n_rows).astype(np.float32)
    distance[:, ~_stays_inside(lines, n).any(axis=0)] = np.inf
    middle_line = np.full(n_windows, len(lines.offsets) // 2)
    anchor, least, second = _best_two(distance, radius)
    return BestTrajectories(anchor, middle_line, least, second)


def _hybrid(enhanced: FloatArray, lines: Lines, radius: int) -> BestTrajectories:
    """Return the best of the lines through some frame's best reference, for every window."""
    n_windows, n = len(enhanced) - lines.n_rows + 1, enhanced.shape[1]
    windows, rows = np.arange(n_windows), np.arange(lines.n_rows)
    best_reference = enhanced.argmin(axis=1)
    distance = np.full((n_windows, n), np.inf, np.float32)
    slope = np.zeros((n_windows, n), np.int64)
    inside = _stays_inside(lines, n)
    for s, offsets in enumerate(lines.offsets):
        for t in range(lines.n_rows):
            anchor = best_reference[t : t + n_windows] - offsets[t]
            kept = (anchor >= 0) & (anchor < n)
            kept[kept] = inside[s, anchor[kept]]
            window, at = windows[kept], anchor[kept]
            pairs = enhanced[window[:, None] + rows, at[:, None] + offsets]
            sums = pairs.sum(axis=1)
            better = sums < distance[window, at]
            distance[window[better], at[better]] = sums[better]
            slope[window[better], at[better]] = s
    anchor, least, second = _best_two(distance, radius)
    return BestTrajectories(anchor, slope[windows, anchor], least, second)


def _stays_inside(lines: Lines, n_references: int) -> Array:
    """Return bool (S, R): whether line s about reference r stays on the map."""
    anchors = np.arange(n_references)
    low, high = lines.offsets.min(axis=1), lines.offsets.max(axis=1)
    inside: Array = (anchors + low[:, None] >= 0) & (anchors + high[:, None] < n_references)
    return inside


def _best_two(distance: FloatArray, radius: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the first least of each row, its place, and the least one further than `radius`."""
    rows = np.arange(len(distance))
    anchor = distance.argmin(axis=1)
    best = distance[rows, anchor]
    around = np.abs(np.arange(distance.shape[1]) - anchor[:, None]) <= radius
    return anchor, best, np.where(around, np.inf, distance).min(axis=1).astype(np.float32)


def _round_away(values: Array) -> IntArray:
    """Round half away from zero; the tiny addition keeps 2.5 from being 2.4999."""
    return (np.sign(values) * np.floor(np.abs(values) + 0.5 + 1e-9)).astype(np.int64)
