"""What the compression benchmarks share: sets at one size, accuracies with paired intervals."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from _real_sets import real_sets

import retraverse as rt
from retraverse.images import Traverse, Worsening, worsen_frame
from retraverse.maps.describe import describe_traverse
from retraverse.metrics import bootstrap_interval
from retraverse.techniques import Descriptions, Technique
from retraverse.types import FloatArray, ImageArray

TECHNIQUES: dict[str, tuple[str, dict[str, Any]]] = {
    "HOG 256": ("hog", {"form": "chapter6"}),
    "CoHOG": ("cohog", {"precision": "int8"}),
    "ConvSequential": ("convsequential", {"precision": "int8", "roi": "each"}),
    "GIST 128": ("gist", {"resolution": 128}),
    "patchnorm": ("patchnorm", {}),
    "ORB": ("orb", {}),
}
RESIZE: dict[str, int | None] = {
    "corridor": None,
    "stromovka": 224,
    "gardens_point_thumbnails": None,
}
SHORT = {"gardens_point_thumbnails": "gardens (thumbnails)", "stromovka": "stromovka 224"}
BLOCK = 10
"""Neighbouring windows drawn together by the bootstrap."""


@dataclass(frozen=True)
class PictureSet:
    """A real set whose pictures were decoded and resized once."""

    name: str
    query: tuple[ImageArray, ...]
    reference: tuple[ImageArray, ...]
    truth: rt.GroundTruth

    @property
    def title(self) -> str:
        return SHORT.get(self.name, self.name)


def picture_sets(data: Path, resize: dict[str, int | None] | None = None) -> Iterator[PictureSet]:
    """Yield corridor, stromovka at 224 px (OpenCV) and gardens, as arrays."""
    sides = RESIZE | (resize or {})
    for real in real_sets(data):
        if real.name in RESIZE:
            worsening = Worsening(sides[real.name], "opencv")
            yield PictureSet(
                real.name,
                pictures(real.query, worsening),
                pictures(real.reference, worsening),
                real.truth,
            )


def pictures(traverse: Traverse, worsening: Worsening) -> tuple[ImageArray, ...]:
    return tuple(worsen_frame(frame, worsening).frame.colour() for frame in traverse)


def as_traverse(images: Iterable[ImageArray], name: str = "pictures") -> Traverse:
    frames = tuple(rt.Frame.from_array(image, index=i) for i, image in enumerate(images))
    return Traverse(name, name, frames)


def describe(images: Iterable[ImageArray] | Traverse, technique: Technique) -> Descriptions:
    drive = images if isinstance(images, Traverse) else as_traverse(images)
    return Descriptions.stack(describe_traverse(drive, technique, threads=1), technique.layout)


def hits(
    scores: FloatArray, truth: rt.GroundTruth, length: int, starts: Sequence[int] | None = None
) -> np.ndarray:
    """Return whether each window (that begins at `starts`) found its place, float64."""
    matches = rt.match_similarity(scores, sequence_length=length)
    correct = truth.is_correct(matches.query, matches.reference).astype(float)
    return correct if starts is None else correct[np.asarray(starts)]


def interval(values: np.ndarray) -> str:
    """Return mean [low, high]: 95 %, circular block bootstrap."""
    low, high = bootstrap_interval(values, block_length=min(BLOCK, len(values)))
    return f"{values.mean():+.3f} [{low:+.3f}, {high:+.3f}]"


def share(values: np.ndarray) -> str:
    low, high = bootstrap_interval(values, block_length=min(BLOCK, len(values)))
    return f"{values.mean():.3f} [{low:.3f}, {high:.3f}]"


def print_head(*columns: str) -> None:
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")


def print_row(*cells: object) -> None:
    print(f"| {' | '.join(str(cell) for cell in cells)} |", flush=True)
