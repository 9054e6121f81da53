"""Regional HOG with entropy regions of interest: what CoHOG and ConvSequential-SLAM share.

The picture in the source's step order (thesis, sections 3.2.2 to 3.2.4):

1. resize to a square; 2. one histogram of gradients per 2x2 cells of 16 pixels ("region"),
L2-normalised; 3. the local entropy of every region; 4. regions at or above `roi_entropy` are
the region of interest (ROI); 5. a query's score against a reference is the mean, over the
query's ROI, of each region's best match anywhere in the reference (algorithm 1).

Step 5 is not symmetric: the ROI is the query's. A region's best match does not depend on the
ROI, so many weightings of one query's regions cost hardly more than one.
"""

import logging
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from retraverse import kernels
from retraverse.images import Frame, GreyPath
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.parameters import check_multiple, check_range, parameter
from retraverse.types import Array, BoolArray, FloatArray, ImageArray

__all__ = ["CELL", "MAX_ENTROPY", "RegionalHog", "RegionalHogParameters"]

logger = logging.getLogger(__name__)

CELL = 16
"""Side of a cell in pixels (W2 = H2 of the thesis)."""
BINS = 8
"""Gradient directions (L of the thesis)."""
ENTROPY_SIDE = 100
"""The entropy map is computed at this size."""
ENTROPY_RADIUS = 5
"""Radius in pixels of the disk local entropy is taken over: 81 pixels."""
MAX_ENTROPY = float(np.log2(81) / 8)
"""The largest entropy a region can have: 81 different pixels, on the 0..8 scale divided by 8."""


@dataclass(frozen=True)
class RegionalHogParameters:
    """What regional HOG descriptions and their regions of interest depend on."""

    resolution: int = parameter(512, "side of the square picture in pixels, 16 to 1024")
    roi_entropy: float = parameter(0.5, "regions at or above this entropy are matched, 0 to 0.7925")
    orientation: Literal["signed", "unsigned"] = parameter(
        "signed", "gradient direction over 360 degrees (authors' program) or 180 (text)"
    )
    magnitude: Literal["mean", "euclidean"] = parameter(
        "mean", "|dx + dy| / 2 (authors' program) or the Euclidean length (text)"
    )
    grey: GreyPath = parameter(
        "from_colour", "how grey is made: by the picture's decoder, or from decoded colour"
    )
    precision: Literal["float32", "int8"] = parameter(
        "float32", "descriptor in float32, or in 8 bits: a quarter of the size, faster"
    )

    def __post_init__(self) -> None:
        """Check every range."""
        check_multiple("resolution", self.resolution, CELL, CELL, 1024)
        check_range(
            "roi_entropy",
            self.roi_entropy,
            0.0,
            MAX_ENTROPY,
            ": no region of 81 pixels can have more than log2(81) / 8 = 0.7925",
        )


class RegionalHog:
    """The descriptions and comparisons that regional techniques inherit."""

    name: ClassVar[str]
    summary: ClassVar[str]
    citation: ClassVar[str]
    version: ClassVar[int] = 1

    def __init__(self, parameters: RegionalHogParameters) -> None:
        self.parameters = parameters
        side = parameters.resolution // CELL - 1
        self.n_regions = side * side
        descriptor_dtype = "float32" if parameters.precision == "float32" else "uint8"
        self.layout = Layout(
            "regional",
            {
                "descriptor": ArraySpec((self.n_regions, 4 * BINS), descriptor_dtype),
                "region_entropy": ArraySpec((self.n_regions,), "float32"),
                "entropy": ArraySpec((), "float64"),
            },
        )
        self.warns_of_empty_roi = True
        """Whether the next picture without a region of interest is said in a warning. False once
        it was; who counts such pictures and says it for many drives at once sets it, too."""

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in grey, by the path the parameters name."""
        return frame.grey(self.parameters.grey)

    def describe(self, image: ImageArray) -> Description:
        """Return the regions' histograms, their entropies, and the picture's entropy in [0, 1]."""
        import cv2

        size = self.parameters.resolution
        grey = np.asarray(cv2.resize(image, (size, size)), dtype=np.uint8)
        histograms = kernels.regional_hog(
            grey,
            cell=CELL,
            bins=BINS,
            orientation=self.parameters.orientation,
            magnitude=self.parameters.magnitude,
        )
        small = np.asarray(cv2.resize(grey, (ENTROPY_SIDE, ENTROPY_SIDE)), dtype=np.uint8)
        entropy_map = kernels.local_entropy(small, radius=ENTROPY_RADIUS)
        region_entropy, entropy = kernels.region_entropies(entropy_map, size=size, cell=CELL)
        return {
            "descriptor": self._quantise(histograms),
            "region_entropy": region_entropy.astype(np.float32),
            "entropy": np.array(entropy, dtype=np.float64),
        }

    def region_weights(self, queries: Descriptions) -> FloatArray:
        """Return float32 (Q, regions): 1 / G in the G regions of interest, 0 elsewhere.

        A picture without any region of interest is matched by all its regions: the authors'
        program divides 0 by 0 there. That is said once, in a warning.
        """
        threshold = np.float32(self.parameters.roi_entropy)
        chosen: BoolArray = np.asarray(queries.arrays["region_entropy"] >= threshold)
        empty = self.empty_roi(queries)
        if empty.any():
            if self.warns_of_empty_roi:
                self.warns_of_empty_roi = False
                self.warn_of_empty_roi(int(empty.sum()), len(queries))
            chosen = chosen | empty[:, np.newaxis]
        counts = chosen.sum(axis=1, keepdims=True, dtype=np.float32)
        weights: FloatArray = chosen / np.maximum(counts, np.float32(1))
        return weights

    def empty_roi(self, queries: Descriptions) -> BoolArray:
        """Return which pictures have no region of interest, bool (Q,)."""
        threshold = np.float32(self.parameters.roi_entropy)
        return np.asarray(~(queries.arrays["region_entropy"] >= threshold).any(axis=1))

    def warn_of_empty_roi(self, n_empty: int, n_pictures: int) -> None:
        """Say in a warning how many pictures have no region of interest, and what is done."""
        logger.warning(
            "%s: %d of %d pictures have no region with entropy >= roi_entropy %.3g; "
            "all their regions are matched instead (dark or flat pictures? lower roi_entropy)",
            self.name,
            n_empty,
            n_pictures,
            self.parameters.roi_entropy,
        )

    def weighted_similarity(
        self, query: Array, references: Array, weights: FloatArray
    ) -> FloatArray:
        """Return float32 (M, R): one query against R references under M weightings.

        Algorithm 1 with the ROI given from outside: the weighted sum, over the query's regions,
        of each region's best match in the reference.
        """
        if self.n_regions == 0:
            return np.zeros((len(weights), len(references)), np.float32)
        return kernels.regional_scores(query, references, weights)

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R) in [0, 1]: each query by its own region of interest."""
        weights = self.region_weights(queries)
        scores = np.empty((len(queries), len(references)), np.float32)
        for row, query in enumerate(queries.descriptor):
            scores[row] = self.weighted_similarity(
                query, references.descriptor, weights[row : row + 1]
            )[0]
        return scores

    def _quantise(self, histograms: FloatArray) -> Array:
        if self.parameters.precision == "float32":
            return histograms
        return kernels.quantise_regions(histograms)
