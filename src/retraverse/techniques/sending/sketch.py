"""Sketch: the signs of a descriptor along directions that all robots know without talking."""

import hashlib
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np

from retraverse.errors import ConfigError
from retraverse.techniques.base import ArraySpec
from retraverse.types import Array, FloatArray, ImageArray, IntArray

__all__ = ["Sketch"]

_MOST_BITS = 1 << 20


@dataclass(frozen=True)
class Sketch:
    """One bit for each of some random directions: on which side of zero the descriptor lies.

    After Charikar, "Similarity estimation techniques from rounding algorithms", STOC, 2002; the
    directions are rows of a Hadamard matrix under random changes of sign (Ailon and Chazelle, "The
    fast Johnson-Lindenstrauss transform", SIAM J. Comput. 39, 2009), so that a descriptor of D
    numbers costs D log D additions for every D directions. They follow from a seed: nothing is
    learned, nothing has to be exchanged before. The descriptor's length is sent as well.

    What arrives is the mean of the directions, each with its sign, at that length: the expectation
    of its product with any vector is proportional to the descriptor's own.
    """

    name: ClassVar[str] = "sketch"
    summary: ClassVar[str] = "Signs along random directions: needs nothing but a seed"
    is_for_floats: ClassVar[bool] = True
    bits: int = field(default=1024, metadata={"help": "directions, a multiple of 8"})
    seed: int = field(default=0, metadata={"help": "which directions; both ends need the same"})

    def __post_init__(self) -> None:
        """Check every range."""
        if not 8 <= self.bits <= _MOST_BITS or self.bits % 8:
            raise ConfigError(
                f"sketch: bits: got {self.bits}, expected a multiple of 8 up to {_MOST_BITS}"
            )
        if self.seed < 0:
            raise ConfigError(f"sketch: seed: got {self.seed}, expected a whole number from 0")

    def n_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_bytes`."""
        return 4 + self.bits // 8

    def n_shared_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_shared_bytes`: none, a seed apart."""
        return 0

    def coder(self, reference: Array) -> "SketchCoder":
        """See `Coding.coder`."""
        dimension = reference.shape[1]
        return SketchCoder(dimension, _directions(dimension, self.bits, self.seed))


@dataclass(frozen=True)
class SketchCoder:
    """Both ends of a sketch."""

    dimension: int
    blocks: tuple[tuple[FloatArray, IntArray], ...]
    """For each block of directions +1 or -1 for every number, (D,), and the rows of the Hadamard
    matrix that are looked at: all, but in the last block."""

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        padding = (0, 0), (0, _padded(self.dimension) - self.dimension)
        along = [
            _hadamard(np.pad(rows * flips, padding))[:, chosen] for flips, chosen in self.blocks
        ]
        signs = np.packbits(np.concatenate(along, axis=1) >= 0, axis=1)
        return np.concatenate([_lengths(rows).astype("<f4").view(np.uint8), signs], axis=1)

    def decode(self, messages: ImageArray) -> FloatArray:
        """See `Coder.decode`."""
        length = np.ascontiguousarray(messages[:, :4]).view("<f4")
        signs = np.unpackbits(messages[:, 4:], axis=1).astype(np.float32) * 2 - 1
        rows = np.zeros((len(messages), self.dimension), np.float32)
        for flips, chosen in self.blocks:
            along = np.zeros((len(messages), _padded(self.dimension)), np.float32)
            along[:, chosen], signs = signs[:, : len(chosen)], signs[:, len(chosen) :]
            rows += _hadamard(along)[:, : self.dimension] * flips
        scale = _lengths(rows)
        return np.asarray(rows * (length / np.where(scale > 0, scale, 1)), np.float32)


def _lengths(rows: FloatArray) -> Array:
    return np.asarray(np.linalg.norm(rows.astype(np.float64), axis=1, keepdims=True))


@lru_cache(maxsize=8)
def _directions(dimension: int, bits: int, seed: int) -> tuple[tuple[FloatArray, IntArray], ...]:
    """Return signs and rows that any version of any library makes of a seed."""
    size = _padded(dimension)
    blocks = []
    for block, start in enumerate(range(0, bits, size)):
        name = f"retraverse sketch {seed} {block}".encode()
        words = np.frombuffer(hashlib.shake_256(name).digest(8 * size), "<u8")
        flips = np.where(words[:dimension] & 1, 1, -1).astype(np.float32)
        blocks.append((flips, np.argsort(words >> 1, kind="stable")[: bits - start]))
    return tuple(blocks)


def _padded(dimension: int) -> int:
    """Return the next power of two: Hadamard matrices of these sizes are the simple ones."""
    return 1 << max(3, (dimension - 1).bit_length())


def _hadamard(rows: FloatArray) -> FloatArray:
    """Return rows (N, 2^k) times the Hadamard matrix of Sylvester, float32 (N, 2^k)."""
    n_rows, size = rows.shape
    half = 1
    while half < size:
        pairs = rows.reshape(n_rows, -1, 2, half)
        low, high = pairs[:, :, 0], pairs[:, :, 1]
        rows = np.stack([low + high, low - high], axis=2)
        half *= 2
    return rows.reshape(n_rows, size)
