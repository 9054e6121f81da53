"""Regions that tell no place, learned from the map against itself, and left out of matching.

Regional matching lets every region of a query find its best match in a reference. Sky, foliage,
or the robot's own bonnet find one as good in any frame as in the right one. The reference drive
shows which: a region position is *distinctive* as far as it is matched better by the neighbouring
frames, which show the same place, than by frames far away, which do not. The least distinctive
positions are masked: their weight becomes 0. No labels and no query are needed.

Measured on four public drives this helps where much of the picture is foliage and costs a little
where all of it is of use, which the reference alone does not tell apart: so it is offered, not
the default. `docs/matching.md` has the figures.

Source: the thesis names dynamic objects and vegetation as open (section 8.2); this answer is ours.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.images import Frame
from retraverse.maps import RouteMap
from retraverse.matching.self_similarity import Sample, sample_map
from retraverse.techniques import Description, Descriptions, Layout, RegionalTechnique, Technique
from retraverse.types import (
    Array,
    BoolArray,
    FloatArray,
    ImageArray,
    Progress,
    no_progress,
)

__all__ = ["MASK_QUANTILE", "RegionMask", "learn_region_mask", "masked", "masked_map"]

MASK_QUANTILE = 0.1
"""One region in ten is masked unless told otherwise."""
N_SAMPLES = 32
"""Frames of the map whose regions are looked for in neighbours and in one another."""
FAR_FRAMES = 25
"""Frames further apart than this show two places, as in `calibrated_length`."""


@dataclass(frozen=True, eq=False)
class RegionMask:
    """Which region positions are matched."""

    kept: BoolArray
    """(regions,) False where a region is left out."""
    distinctiveness: FloatArray
    """(regions,) how much better neighbours match it than far frames do; NaN where it was never
    part of a region of interest: such regions are kept."""
    quantile: float
    """Share of the regions that was to be left out."""


def learn_region_mask(
    route: RouteMap, *, quantile: float = MASK_QUANTILE, progress: Progress = no_progress
) -> RegionMask:
    """Return which regions of this map's technique say something about the place.

    Parameters
    ----------
    route : RouteMap
        Of a regional technique; at least 3 frames.
    quantile : float in [0, 1)
        The share of regions to leave out, least distinctive first.
    progress : Progress
        Watches the frames looked at.

    Raises
    ------
    ConfigError
        If `quantile` is out of range, or the technique has no regions.
    InputError
        If the map has fewer than 3 frames.

    Notes
    -----
    Distinctiveness of region g = mean over 32 frames, evenly spread, of (mean best match of g in
    the two neighbours) - (mean best match of g in those of the 32 that lie more than 25 frames, or
    a third of a short map, away). Only frames whose region of interest holds g count for it.
    """
    if not 0 <= quantile < 1:
        raise ConfigError(f"quantile: got {quantile!r}, expected 0 or more, below 1")
    technique = _regional(route.technique)
    if len(route) < 3:
        raise InputError(f"region mask: got a map of {len(route)} frames, expected at least 3")
    sample = sample_map(route, N_SAMPLES)
    gains = _region_gains(technique, route, sample, progress)
    in_roi = technique.region_weights(sample.descriptions) > 0
    counts = in_roi.sum(axis=0)
    distinctiveness = np.where(
        counts > 0, (gains * in_roi).sum(axis=0) / np.maximum(counts, 1), np.nan
    ).astype(np.float32)
    # Inverted, so that regions without a number stay.
    kept = ~(distinctiveness < np.nanquantile(distinctiveness, quantile))
    return RegionMask(kept, distinctiveness, quantile)


def masked(technique: Technique, mask: RegionMask) -> RegionalTechnique:
    """Return the technique with the masked regions left out of every comparison.

    Descriptions, name and parameters are those of `technique`: only comparing changes. A query
    whose region of interest is masked altogether is compared by all of it.

    Raises
    ------
    ConfigError
        If the technique has no regions.
    ShapeError
        If the mask is of another number of regions.
    """
    regional = _regional(technique)
    n_regions = regional.layout.descriptor.shape[0]
    if mask.kept.shape != (n_regions,):
        raise ShapeError(
            f"region mask: got one of {mask.kept.size} regions, expected {n_regions} "
            f"({technique.name}); was it learned at another resolution?"
        )
    # `Technique` promises name and kin on the class; here they are the instance's.
    return cast(RegionalTechnique, _MaskedTechnique(regional, mask))


def masked_map(route: RouteMap, mask: RegionMask) -> RouteMap:
    """Return the map, in memory, with its technique masked: for `match` and `similarity`."""
    return route.with_technique(masked(route.technique, mask))


class _MaskedTechnique:
    """A regional technique whose weights are those of another, less the masked regions."""

    def __init__(self, technique: RegionalTechnique, mask: RegionMask) -> None:
        self.name = technique.name
        self.summary = technique.summary
        self.citation = technique.citation
        self.version = technique.version
        self.parameters: Any = technique.parameters
        self.layout: Layout = technique.layout
        self._technique = technique
        self._kept = mask.kept

    def read(self, frame: Frame) -> ImageArray:
        return self._technique.read(frame)

    def describe(self, image: ImageArray) -> Description:
        return self._technique.describe(image)

    def region_weights(self, queries: Descriptions) -> FloatArray:
        """Return float32 (Q, regions), rows sum to 1."""
        unmasked = self._technique.region_weights(queries)
        weights = unmasked * self._kept
        totals = weights.sum(axis=1, keepdims=True)
        usable = totals > 0
        rows: FloatArray = np.where(usable, weights / np.where(usable, totals, 1), unmasked)
        return rows.astype(np.float32)

    def weighted_similarity(
        self, query: Array, references: Array, weights: FloatArray
    ) -> FloatArray:
        return self._technique.weighted_similarity(query, references, weights)

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R): each query by what is left of its region of interest."""
        weights = self.region_weights(queries)
        scores = np.empty((len(queries), len(references)), np.float32)
        for row, query in enumerate(queries.descriptor):
            scores[row] = self.weighted_similarity(
                query, references.descriptor, weights[row : row + 1]
            )[0]
        return scores


def _regional(technique: Technique) -> RegionalTechnique:
    if not isinstance(technique, RegionalTechnique) or not technique.layout.dimension:
        raise ConfigError(
            f"region mask: {technique.name} at these parameters has no regions; expected a "
            "regional technique such as convsequential or cohog"
        )
    return technique


def _region_gains(
    technique: RegionalTechnique, route: RouteMap, sample: Sample, progress: Progress
) -> FloatArray:
    """Return float32 (S, regions): best match in the neighbours less that in far frames."""
    n_regions = technique.layout.descriptor.shape[0]
    # One weighting per region: the kernel then returns every region's best match by itself.
    each_region = np.eye(n_regions, dtype=np.float32)
    gains = np.empty((len(sample.rows), n_regions), np.float32)
    far_distance = sample.far_distance(FAR_FRAMES)
    rows = progress(sample.rows.tolist(), total=len(sample.rows), label="learning region mask")
    for number, row in enumerate(rows):
        query = sample.descriptions.descriptor[number]
        far = sample.descriptions.descriptor[np.abs(sample.rows - row) > far_distance]
        best_near, best_far = (
            technique.weighted_similarity(query, references, each_region).mean(axis=1)
            for references in (_neighbours(route, row), far)
        )
        gains[number] = best_near - best_far
    return gains


def _neighbours(route: RouteMap, row: int) -> Array:
    """Return the descriptors of the frames right before and after one."""
    sides = [route.descriptions(side, side + 1) for side in (row - 1, row + 1) if side >= 0]
    return np.concatenate([side.descriptor for side in sides if len(side)])
