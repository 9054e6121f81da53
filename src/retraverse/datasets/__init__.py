"""Traverses that come with a truth: ground truths, and (in `simulated`) a rendered route."""

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.position_files import load_positions
from retraverse.datasets.truth_sources import (
    aligned,
    from_positions,
    from_positives,
    ground_truth,
)

__all__ = [
    "GroundTruth",
    "aligned",
    "from_positions",
    "from_positives",
    "ground_truth",
    "load_positions",
]
