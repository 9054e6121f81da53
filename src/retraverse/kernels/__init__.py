"""Kernels: the few loops that take nearly all the time, compiled, with NumPy twins.

Every function here runs compiled code where it was built, else NumPy with the same result.
Contents: how kernels run (`backend`), regional matching (`regional`), regional HOG and local
entropy (`encoding`), sequence scores along the diagonals of a similarity matrix (`diagonal`),
straight trajectories of several slopes (`trajectories`), paths of any speed (`paths`),
differences of thumbnails (`thumbnails`), matching of binary keypoints (`keypoints`).
"""

from retraverse.kernels.backend import backend, default_threads, instruction_sets
from retraverse.kernels.diagonal import (
    BestDiagonals,
    DiagonalSums,
    best_diagonals,
    best_diagonals_variable,
    diagonal_scores,
)
from retraverse.kernels.encoding import local_entropy, region_entropies, regional_hog
from retraverse.kernels.keypoints import keypoint_matches
from retraverse.kernels.paths import (
    GraphRows,
    Motion,
    ViterbiRows,
    backward,
    dtw_steps,
    forward,
    graph,
    viterbi,
)
from retraverse.kernels.regional import quantise_regions, regional_scores
from retraverse.kernels.thumbnails import thumbnail_differences
from retraverse.kernels.trajectories import BestTrajectories, best_trajectories

__all__ = [
    "BestDiagonals",
    "BestTrajectories",
    "DiagonalSums",
    "GraphRows",
    "Motion",
    "ViterbiRows",
    "backend",
    "backward",
    "best_diagonals",
    "best_diagonals_variable",
    "best_trajectories",
    "default_threads",
    "diagonal_scores",
    "dtw_steps",
    "forward",
    "graph",
    "instruction_sets",
    "keypoint_matches",
    "local_entropy",
    "quantise_regions",
    "region_entropies",
    "regional_hog",
    "regional_scores",
    "thumbnail_differences",
    "viterbi",
]
