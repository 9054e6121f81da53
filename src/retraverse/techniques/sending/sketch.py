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

    After Charikar, "Similarity estimation techniques from rounding algorithms", STOC, 2002. Each
    block of directions is a random rotation: twice random changes of sign and a Hadamard matrix,
    as in Ailon and Chazelle, "The fast Johnson-Lindenstrauss transform and approximate nearest
    neighbors", SIAM J. Comput. 39, 2009; once would leave a descriptor of few large numbers in few
    directions. D numbers cost D log D additions for every D directions. They follow from a seed:
    nothing is learned, nothing has to be exchanged before. The descriptor's length is sent as well.

    What arrives is the sum of the directions, each with its sign, at that length. Over many seeds
    its mean points where the descriptor does, so that products with any vector keep their order.
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
        return SketchCoder(dimension, _rotations(dimension, self.bits, self.seed))


@dataclass(frozen=True)
class Rotation:
    """Random changes of sign and the Hadamard matrix, twice, and which of its rows are used."""

    flips: FloatArray
    """+1 or -1 for every number of both rounds, (2, padded D)."""
    chosen: IntArray

    def turn(self, rows: FloatArray) -> FloatArray:
        """Return how far rows (N, padded D) reach along the directions, (N, directions)."""
        first, second = self.flips
        return np.asarray(_hadamard(_hadamard(rows * first) * second)[:, self.chosen])

    def turn_back(self, along: FloatArray) -> FloatArray:
        """Return the sum of the directions with such weights, (N, padded D)."""
        first, second = self.flips
        rows = np.zeros((len(along), len(first)), np.float32)
        rows[:, self.chosen] = along
        return np.asarray(_hadamard(_hadamard(rows) * second) * first)


@dataclass(frozen=True)
class SketchCoder:
    """Both ends of a sketch."""

    dimension: int
    rotations: tuple[Rotation, ...]
    """One for each block of directions; all of its rows are used, but in the last."""

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        padded = np.pad(rows, ((0, 0), (0, _padded(self.dimension) - self.dimension)))
        along = [rotation.turn(padded) for rotation in self.rotations]
        signs = np.packbits(np.concatenate(along, axis=1) >= 0, axis=1)
        return np.concatenate([_lengths(rows).astype("<f4").view(np.uint8), signs], axis=1)

    def decode(self, messages: ImageArray) -> FloatArray:
        """See `Coder.decode`."""
        length = np.ascontiguousarray(messages[:, :4]).view("<f4")
        signs = np.unpackbits(messages[:, 4:], axis=1).astype(np.float32) * 2 - 1
        rows = np.zeros((len(messages), self.dimension), np.float32)
        for rotation in self.rotations:
            block, signs = np.split(signs, [len(rotation.chosen)], axis=1)
            rows += rotation.turn_back(block)[:, : self.dimension]
        scale = _lengths(rows)
        return np.asarray(rows * (length / np.where(scale > 0, scale, 1)), np.float32)


def _lengths(rows: FloatArray) -> Array:
    return np.asarray(np.linalg.norm(rows.astype(np.float64), axis=1, keepdims=True))


@lru_cache(maxsize=8)
def _rotations(dimension: int, bits: int, seed: int) -> tuple[Rotation, ...]:
    """Return the rotations that any version of any library makes of a seed."""
    size = _padded(dimension)
    made = []
    for block, start in enumerate(range(0, bits, size)):
        name = f"retraverse sketch {seed} {block}".encode()
        words = np.frombuffer(hashlib.shake_256(name).digest(8 * size), "<u8")
        flips = [np.where(words >> bit & 1, 1, -1).astype(np.float32) for bit in range(2)]
        chosen = np.argsort(words >> 2, kind="stable")[: bits - start]
        made.append(Rotation(np.array(flips), chosen))
    return tuple(made)


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
