"""Projected: where a descriptor lies along the directions in which the map's own differ most."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from retraverse.errors import ConfigError
from retraverse.techniques.base import ArraySpec
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["Projected"]

_MOST_FRAMES = 512
"""Frames of the map, evenly spread, that the directions are learned from; bounds memory."""
_REACH = 4.0
"""Standard deviations of the map's frames that a byte reaches to either side."""
_NEGLIGIBLE = 1e-9
"""Variance along a direction, as a share of the largest, from which on it is rounding."""


@dataclass(frozen=True)
class Projected:
    """Principal components of the map's descriptors, one byte each.

    Directions are learned from the map alone, no label and no query; who sends must have been
    given them (`n_shared_bytes`), as float32. Frames of the map without a descriptor do not count.
    A map of fewer frames has fewer directions: the bytes that are over are zero.
    """

    name: ClassVar[str] = "projected"
    summary: ClassVar[str] = "Principal components of the map, a byte each; they are sent before"
    is_for_floats: ClassVar[bool] = True
    dimensions: int = field(default=64, metadata={"help": "directions, a byte each"})

    def __post_init__(self) -> None:
        """Check every range."""
        if not 1 <= self.dimensions < _MOST_FRAMES:
            raise ConfigError(
                f"projected: dimensions: got {self.dimensions}, expected 1 to {_MOST_FRAMES - 1}"
            )

    def n_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_bytes`."""
        return self.dimensions

    def n_shared_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_shared_bytes`: mean, directions and steps, four bytes a number."""
        return 4 * ((1 + self.dimensions) * spec.n_numbers + self.dimensions)

    def coder(self, reference: Array) -> "ProjectedCoder":
        """See `Coding.coder`."""
        described = np.flatnonzero(reference.any(axis=1))
        if not len(described):
            described = np.zeros(1, int)
        places = np.linspace(0, len(described) - 1, min(len(described), _MOST_FRAMES))
        some = reference[described[places.astype(int)]].astype(np.float64)
        mean = some.mean(axis=0)
        some -= mean
        # Of the small matrix of products: frames are fewer than numbers.
        variance, mixes = np.linalg.eigh(some @ some.T)
        largest = np.argsort(-variance)[: self.dimensions]
        kept = largest[variance[largest] > _NEGLIGIBLE * max(variance[largest[0]], 0)]
        directions = np.zeros((self.dimensions, reference.shape[1]))
        steps = np.zeros(self.dimensions)
        directions[: len(kept)] = (mixes[:, kept] / np.sqrt(variance[kept])).T @ some
        steps[: len(kept)] = np.sqrt(variance[kept] / len(some)) * _REACH / 127
        return ProjectedCoder(*map(_as_shared, (mean, directions, steps)))


def _as_shared(values: Array) -> Array:
    """Return numbers as both ends have them: float32 in value, float64 in type."""
    return values.astype(np.float32).astype(np.float64)


@dataclass(frozen=True)
class ProjectedCoder:
    """Both ends of a projection; sums in float64, so that bytes do not depend on their order."""

    mean: Array
    """Of the map's descriptors, (D,)."""
    directions: Array
    """Of length 1 and at right angles, (dimensions, D); zero where the map has no more."""
    steps: Array
    """What one unit of a byte stands for, (dimensions,)."""

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        along = (rows - self.mean) @ self.directions.T
        whole = np.rint(along / np.where(self.steps > 0, self.steps, 1)).clip(-127, 127)
        return whole.astype(np.int8).view(np.uint8)

    def decode(self, messages: ImageArray) -> FloatArray:
        """See `Coder.decode`."""
        along = messages.view(np.int8) * self.steps
        return np.asarray(self.mean + along @ self.directions, np.float32)
