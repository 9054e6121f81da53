"""What a coding of descriptors is: numbers in, bytes out, and numbers again at the other end.

Conventions
- Descriptors are flat here, one row a frame: regions follow each other.
- What is received is compared with the map's own descriptors, which nobody coded.
- Every message of a coding has the same length, whatever the frame.
"""

import time
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from retraverse.errors import ShapeError
from retraverse.techniques.base import ArraySpec, Descriptions, Layout
from retraverse.types import Array, ImageArray

__all__ = ["Coder", "Coding", "Received", "received", "sent_bytes"]

_BLOCK_ROWS = 64
"""Frames that are coded in one go; bounds memory."""


class Coder(Protocol):
    """Both ends of a link, for descriptors of one length."""

    def encode(self, rows: Array) -> ImageArray:
        """Return the messages of descriptors (N, D): uint8 (N, B)."""
        ...

    def decode(self, messages: ImageArray) -> Array:
        """Return the descriptors (N, D) that messages stand for, of the type that was encoded."""
        ...


class Coding(Protocol):
    """A way of writing descriptors as bytes: a frozen dataclass of its parameters."""

    name: ClassVar[str]
    """What users call it: ``"int8"``."""
    summary: ClassVar[str]
    """One line for lists."""
    is_for_floats: ClassVar[bool]
    """Whether it codes float32 descriptors only."""

    def n_bytes(self, spec: ArraySpec) -> int:
        """Return the bytes of one frame's message."""
        ...

    def n_shared_bytes(self, spec: ArraySpec) -> int:
        """Return the bytes that both ends must have before the first message; 0 = none."""
        ...

    def coder(self, reference: Array) -> Coder:
        """Return both ends for a map with the descriptors `reference`, (R, D)."""
        ...


@dataclass(frozen=True)
class Received:
    """Descriptions as they arrive where the map is."""

    descriptions: Descriptions
    frame_s: float
    """Seconds that writing and reading one frame's message took."""


def sent_bytes(layout: Layout, chosen: Coding) -> int:
    """Return the bytes of one frame's description: arrays beside the descriptor go as they are."""
    others = sum(spec.n_bytes for name, spec in layout.arrays.items() if name != "descriptor")
    return chosen.n_bytes(layout.descriptor) + others


def received(queries: Descriptions, references: Descriptions, chosen: Coding) -> Received:
    """Return the query's descriptions as they arrive where the map is.

    Parameters
    ----------
    queries, references : Descriptions
        Of the query and of the map. A frame without a descriptor (all zeros) sends none, and none
        arrives.
    chosen : Coding

    Raises
    ------
    ShapeError
        If the descriptors are not float32 and the coding is for these.
    """
    sent, known = queries.descriptor, references.descriptor
    if chosen.is_for_floats and sent.dtype != np.float32:
        raise ShapeError(
            f"descriptors: got {sent.dtype}, expected float32 to be sent as {chosen.name}"
        )
    rows = sent.reshape(len(sent), -1)
    coder = chosen.coder(known.reshape(len(known), -1))
    arrived = np.zeros_like(rows)
    there = np.flatnonzero(rows.any(axis=1))
    began = time.perf_counter()
    for start in range(0, len(there), _BLOCK_ROWS):
        block = there[start : start + _BLOCK_ROWS]
        arrived[block] = coder.decode(coder.encode(rows[block]))
    frame_s = (time.perf_counter() - began) / max(1, len(there))
    arrays = {**queries.arrays, "descriptor": arrived.reshape(sent.shape)}
    return Received(Descriptions(arrays), frame_s)
