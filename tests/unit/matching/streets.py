"""Pictures of one long random street, and a technique whose similarity is another's, rescaled."""

from typing import Any

import numpy as np

import retraverse as rt
from retraverse.techniques import Descriptions, Technique
from retraverse.types import FloatArray, ImageArray

__all__ = ["Rescaled", "street"]


def street(n_frames: int, seed: int = 0, step: int = 8) -> list[ImageArray]:
    """Return overlapping views, `step` pixels apart, of a picture full of detail."""
    random = np.random.default_rng(seed)
    coarse = random.integers(0, 256, (12, 13 + n_frames * step // 8)).astype(np.uint8)
    scene = np.kron(coarse, np.ones((8, 8), np.uint8))
    fine = random.integers(0, 12, scene.shape).astype(np.uint8)
    scene = np.minimum(scene, 240) + fine
    return [scene[:, step * i : step * i + 96] for i in range(n_frames)]


class Rescaled:
    """A technique whose similarity is ``factor * similarity + offset`` of another one's."""

    def __init__(self, technique: Technique, factor: float, offset: float) -> None:
        self._technique, self._factor, self._offset = technique, factor, offset

    def __getattr__(self, name: str) -> Any:
        return getattr(self._technique, name)

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        scores = self._technique.similarity(queries, references)
        return np.asarray(self._factor * scores + self._offset, np.float32)


def described(frames: list[ImageArray], technique: Technique) -> Descriptions:
    return Descriptions.stack(
        (technique.describe(technique.read(frame)) for frame in rt.open_traverse(frames)),
        technique.layout,
    )
