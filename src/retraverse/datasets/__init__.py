"""Traverses that come with a truth: ground truths, drives at other speeds, a rendered route.

The rendered route is in `simulated`.
"""

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.position_files import load_positions
from retraverse.datasets.resample import (
    PROFILES,
    Resampling,
    SpeedProfile,
    plan_resampling,
    resample,
)
from retraverse.datasets.truth_sources import (
    aligned,
    from_positions,
    from_positives,
    ground_truth,
)

__all__ = [
    "PROFILES",
    "GroundTruth",
    "Resampling",
    "SpeedProfile",
    "aligned",
    "from_positions",
    "from_positives",
    "ground_truth",
    "load_positions",
    "plan_resampling",
    "resample",
]
