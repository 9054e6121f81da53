"""The map compared with itself: what can be learned before any query, without labels.

Frames of the map that lie side by side show one place; frames far apart show two. A few of them,
evenly spread, stand for all, so that a long map costs no more than a short one.
"""

from dataclasses import dataclass

import numpy as np

from retraverse.maps import RouteMap
from retraverse.techniques import Descriptions
from retraverse.types import IntArray

__all__ = ["Sample", "sample_map"]


@dataclass(frozen=True)
class Sample:
    """Some frames of a map, in their order."""

    rows: IntArray
    """(S,) their rows in the map, rising."""
    descriptions: Descriptions
    """Theirs, S of them."""
    n_frames: int
    """Frames of the whole map."""

    def far_distance(self, wanted: int) -> int:
        """Return how many frames apart is far: `wanted`, in short maps a third of the map."""
        return max(1, min(wanted, self.n_frames // 3))


def sample_map(route: RouteMap, n_samples: int) -> Sample:
    """Return `n_samples` frames of a map evenly spread, or all of a shorter one.

    Memory holds the descriptions of these frames only.
    """
    rows = np.linspace(0, len(route) - 1, min(n_samples, len(route))).round().astype(np.int64)
    rows = np.unique(rows)
    described = Descriptions.concatenate(route.descriptions(row, row + 1) for row in rows.tolist())
    return Sample(rows, described, len(route))
