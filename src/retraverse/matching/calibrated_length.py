"""Dynamic sequence length for any technique, its threshold calibrated on the map alone.

The thesis' window grows while its newest frame is at least 0.9 similar to its first. 0.9 means
something in regional HOG's similarity only; here it is put as a question any technique can answer
from the map compared with itself, without labels and without the query: *how alike are frames that
have nothing to do with one another?* The information threshold is a low quantile of that, by
default the lower quartile: a window grows until its newest frame is more unlike its first than
unrelated frames usually are. So read, the published 0.9 lies at the quantiles .01, .03, .35 and
.69 of the maps of four public drives (median .19, mean .27): the lower quartile stands for it.

Halfway between neighbours and unrelated frames, the threshold that asks whether two frames still
overlap, was tried and gives shorter windows (a mean of 4 frames for 12 on Corridor), whose
accuracy is lower for every technique and drive tried.

The entropy rule needs no calibration: the entropy of a picture does not depend on the technique,
so the published threshold holds.

Contents: `calibrate_growth`, `calibrated_windows`; `describe_entropy`, `with_entropy` for
techniques that do not store the picture's entropy; `Overlap`.
"""

from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.images import Frame, GreyPath, Traverse
from retraverse.maps import RouteMap
from retraverse.maps.describe import in_order
from retraverse.matching.dynamic_length import GrowthRule, Window, dynamic_windows
from retraverse.matching.pairwise import has_descriptor
from retraverse.matching.self_similarity import Sample, sample_map
from retraverse.techniques import Descriptions, Technique
from retraverse.techniques.handmade.picture_entropy import picture_entropy
from retraverse.types import Array, FloatArray, Progress, no_progress

__all__ = [
    "QUANTILE",
    "Overlap",
    "calibrate_growth",
    "calibrated_windows",
    "describe_entropy",
    "ensure_entropy",
    "with_entropy",
]

QUANTILE = 0.25
"""Of the similarities of unrelated frames; see the head of this file."""
N_SAMPLES = 48
"""Frames of the map compared with one another: about 2,000 pairs."""


def calibrate_growth(
    route: RouteMap,
    *,
    quantile: float = QUANTILE,
    base: GrowthRule | None = None,
) -> GrowthRule:
    """Return when windows of this map's technique grow, learned from the map alone.

    Parameters
    ----------
    route : RouteMap
        At least 3 frames.
    quantile : float in [0, 1]
        The information threshold is this quantile of the similarities of far frames. Lower gives
        longer windows.
    base : GrowthRule, optional
        The other thresholds; default: the published ones.

    Returns
    -------
    rule : GrowthRule
        `base` with the information threshold of this technique on this route.

    Raises
    ------
    ConfigError
        If `quantile` is outside [0, 1].
    InputError
        If the map is too short, or fewer than two of its frames have a descriptor.

    Notes
    -----
    Frames are far if they lie more than ``base.max_length`` apart: no window holds both. In a map
    of fewer than three times as many frames, a third of the map. 48 frames, evenly spread, are
    compared with one another, whatever the map's length; frames without a descriptor are left out.
    """
    if not 0 <= quantile <= 1:
        raise ConfigError(f"quantile: got {quantile!r}, expected 0 to 1")
    rule = base or GrowthRule()
    sample = sample_map(route, N_SAMPLES)
    similarity = _far_similarities(route, sample, rule.max_length)
    return replace(rule, information_threshold=float(np.quantile(similarity, quantile)))


def calibrated_windows(
    queries: Descriptions, route: RouteMap, *, rule: GrowthRule | None = None
) -> list[Window]:
    """Return the windows of a query drive under a rule calibrated on its map.

    Parameters
    ----------
    queries : Descriptions
        By the map's technique, with the entropy of every picture: see `with_entropy`.
    route : RouteMap
    rule : GrowthRule, optional
        Default: `calibrate_growth` of the map.

    Raises
    ------
    ConfigError
        If `queries` holds no entropy.
    InputError
        As in `calibrate_growth`.
    """
    if "entropy" not in queries.arrays:
        raise ConfigError(
            f"sequence_length 'dynamic': descriptions by {route.technique.name} hold no entropy; "
            "expected the traverse itself, or with_entropy(queries, describe_entropy(traverse))"
        )
    growth = rule or calibrate_growth(route)
    overlap = Overlap(route.technique, queries)
    return dynamic_windows(queries.arrays["entropy"].reshape(len(queries)), overlap, growth)


def describe_entropy(
    traverse: Traverse,
    *,
    grey: GreyPath = "decoder",
    threads: int | None = None,
    progress: Progress = no_progress,
) -> NDArray[np.float64]:
    """Return the entropy of every picture of a drive, float64 (N,), each in [0, 1].

    Parameters
    ----------
    traverse : Traverse
    grey : {"decoder", "from_colour"}
        How grey is made; ``convsequential`` uses ``decoder``.
    threads : int, optional
        Default: the cores this process may use.
    progress : Progress
        Watches the frames.

    Raises
    ------
    FrameReadError
        If a picture cannot be read.
    """

    def entropy(frame: Frame) -> float:
        return picture_entropy(frame.grey(grey))

    with closing(in_order(entropy, traverse, threads)) as measured:
        watched = progress(measured, total=len(traverse), label="measuring entropy")
        return np.fromiter(watched, np.float64, len(traverse))


def with_entropy(queries: Descriptions, entropy: Array) -> Descriptions:
    """Return the descriptions with the entropy of every picture beside them.

    Raises
    ------
    ShapeError
        If there is not one entropy per frame.
    """
    if entropy.shape != (len(queries),):
        raise ShapeError(
            f"entropy: got shape {entropy.shape}, expected ({len(queries)},): one per frame"
        )
    return Descriptions({**queries.arrays, "entropy": entropy.astype(np.float64)})


def ensure_entropy(
    queries: Descriptions, query: Traverse | Descriptions, *, progress: Progress = no_progress
) -> Descriptions:
    """Return the descriptions of a drive with its entropy, measured where it is not stored.

    Parameters
    ----------
    queries : Descriptions
        Of `query`.
    query : Traverse or Descriptions
        Where the pictures come from; from descriptions alone nothing can be measured, and
        `queries` is returned as it is.
    progress : Progress
        Watches the frames.
    """
    if "entropy" in queries.arrays or isinstance(query, Descriptions):
        return queries
    return with_entropy(queries, describe_entropy(query, progress=progress))


class Overlap:
    """Similarity of a frame with the ones after it, by the technique's own measure.

    For regional techniques that is under the first frame's region of interest. Computed `AHEAD`
    frames at a time, since windows ask for one frame after the other.
    """

    AHEAD = 6

    def __init__(self, technique: Technique, queries: Descriptions) -> None:
        self._technique = technique
        self._queries = queries
        self._first = -1
        self._scores: list[float] = []

    def __call__(self, first: int, later: int) -> float:
        """Return the similarity of query frames `first` and `later`, which comes after it."""
        if first != self._first:
            self._first, self._scores = first, []
        while later - first > len(self._scores):
            start = first + 1 + len(self._scores)
            scores = self._technique.similarity(
                self._queries[first : first + 1], self._queries[start : start + self.AHEAD]
            )
            self._scores.extend(scores[0].tolist())
        return self._scores[later - first - 1]


def _far_similarities(route: RouteMap, sample: Sample, max_length: int) -> FloatArray:
    """Return the similarities of all ordered pairs of far frames with descriptors, flat."""
    apart = np.abs(sample.rows[:, np.newaxis] - sample.rows)
    described = has_descriptor(sample.descriptions)
    far = (apart > sample.far_distance(max_length)) & described & described[:, np.newaxis]
    if not far.any():
        raise InputError(
            f"sequence_length 'dynamic': got a map of {len(route)} frames, "
            f"{int(described.sum())} of {len(described)} looked at with a descriptor; expected "
            "at least 3 frames to calibrate on"
        )
    similarities = route.technique.similarity(sample.descriptions, sample.descriptions)
    return np.asarray(similarities[far])
