"""A technique and frames so small that a map of them is written in a millisecond."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from retraverse.errors import FrameReadError
from retraverse.images import Frame
from retraverse.maps import RouteMap
from retraverse.techniques import ArraySpec, Description, Descriptions, Layout, registry
from retraverse.types import FloatArray, ImageArray

__all__ = ["FakeParameters", "FakeTechnique", "Snapshot", "fake_registered", "frames", "snapshot"]

Snapshot = dict[str, Any]


@dataclass(frozen=True)
class FakeParameters:
    size: int = 8
    gain: float = 1.0


class FakeTechnique:
    """The first pixels are the descriptor; a picture that starts with 255 cannot be read."""

    name: ClassVar[str] = "fake"
    summary: ClassVar[str] = "for the tests of maps"
    citation: ClassVar[str] = "none"
    version: ClassVar[int] = 3

    def __init__(self, parameters: FakeParameters | None = None) -> None:
        self.parameters = parameters or FakeParameters()
        arrays = {
            "descriptor": ArraySpec((2, self.parameters.size), "float32"),
            "entropy": ArraySpec((1,), "float64"),
            "mask": ArraySpec((3,), "uint8"),
        }
        self.layout = Layout("regional", arrays)

    def read(self, frame: Frame) -> ImageArray:
        image = frame.colour()
        if image.flat[0] == 255:
            raise FrameReadError(f"cannot read {frame.name}: it starts with 255")
        return image

    def describe(self, image: ImageArray) -> Description:
        values = image.reshape(-1)[: 2 * self.parameters.size].astype(np.float32)
        return {
            "descriptor": (values * self.parameters.gain).reshape(2, -1),
            "entropy": np.array([image.mean()], np.float64),
            "mask": image.reshape(-1)[:3].copy(),
        }

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        raise NotImplementedError


@contextmanager
def fake_registered() -> Iterator[None]:
    """List the fake technique while the block runs, so that maps of it load by name."""
    registry.techniques()
    registry.register(FakeParameters)(FakeTechnique)
    try:
        yield
    finally:
        del registry._registry._entries["fake"]


def frames(n_frames: int, *, variant: int = 0, first: int = 0) -> list[Frame]:
    """Return frames that number and variant determine; every third has no time."""
    return [_frame(index, variant) for index in range(first, first + n_frames)]


def _frame(index: int, variant: int) -> Frame:
    pixels = np.random.default_rng([variant, index]).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    time = None if index % 3 == 0 else index / 7
    return Frame.from_array(pixels, name=f"{variant}-{index}.jpg", index=index, timestamp_s=time)


def snapshot(route: RouteMap) -> Snapshot:
    """Return all that a map holds, except when and where it was made, ready to compare."""
    described = route.descriptions().arrays
    position = route.frames.position
    return {
        "frames": [repr(frame) for frame in route.frames],
        "position": None if position is None else position.tolist(),
        "arrays": {
            name: (array.dtype.name, array.shape, hashlib.sha256(array.tobytes()).hexdigest())
            for name, array in described.items()
        },
        "thumbnails": [route.thumbnail(row) for row in range(len(route))],
        "content": route.provenance.content_sha256,
        "technique": str(route.provenance.technique),
    }
