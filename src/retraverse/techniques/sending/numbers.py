"""Descriptors sent number by number: as they are, in half, or in a quarter of the bytes."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from retraverse.techniques.base import ArraySpec
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["Exact", "Float16", "Int8"]

_LARGEST_FLOAT16 = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class Exact:
    """The bytes that are compared: four a number, or one where the technique has bytes itself."""

    name: ClassVar[str] = "exact"
    summary: ClassVar[str] = "As they are compared: four bytes a number, most of them"
    is_for_floats: ClassVar[bool] = False

    def n_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_bytes`."""
        return spec.n_bytes

    def n_shared_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_shared_bytes`: none."""
        return 0

    def coder(self, reference: Array) -> "ExactCoder":
        """See `Coding.coder`."""
        return ExactCoder(reference.dtype.newbyteorder("<"))


@dataclass(frozen=True)
class ExactCoder:
    """Both ends of a link for numbers of one type."""

    dtype: np.dtype[Any]

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        return _bytes_of(rows.astype(self.dtype))

    def decode(self, messages: ImageArray) -> Array:
        """See `Coder.decode`."""
        return np.ascontiguousarray(messages).view(self.dtype)


class _Rounded:
    """A coding that rounds numbers one by one: it is its own coder."""

    is_for_floats: ClassVar[bool] = True

    def n_shared_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_shared_bytes`: none."""
        return 0


@dataclass(frozen=True)
class Float16(_Rounded):
    """Two bytes a number; what is too large for them is cut."""

    name: ClassVar[str] = "float16"
    summary: ClassVar[str] = "Every number in two bytes: three decimal figures"

    def n_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_bytes`."""
        return 2 * spec.n_numbers

    def coder(self, reference: Array) -> "Float16":
        """See `Coding.coder`."""
        return self

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        return _bytes_of(np.clip(rows, -_LARGEST_FLOAT16, _LARGEST_FLOAT16).astype("<f2"))

    def decode(self, messages: ImageArray) -> FloatArray:
        """See `Coder.decode`."""
        return np.ascontiguousarray(messages).view("<f2").astype(np.float32)


@dataclass(frozen=True)
class Int8(_Rounded):
    """One byte a number, in steps of 1/127 of the frame's largest, which is sent along."""

    name: ClassVar[str] = "int8"
    summary: ClassVar[str] = "Every number in one byte, and the step of the frame"

    def n_bytes(self, spec: ArraySpec) -> int:
        """See `Coding.n_bytes`."""
        return 4 + spec.n_numbers

    def coder(self, reference: Array) -> "Int8":
        """See `Coding.coder`."""
        return self

    def encode(self, rows: Array) -> ImageArray:
        """See `Coder.encode`."""
        step = (np.abs(rows).max(axis=1, keepdims=True, initial=0) / 127).astype("<f4")
        whole = np.rint(rows / np.where(step > 0, step, 1)).clip(-127, 127).astype(np.int8)
        return np.concatenate([_bytes_of(step), _bytes_of(whole)], axis=1)

    def decode(self, messages: ImageArray) -> FloatArray:
        """See `Coder.decode`."""
        step = np.ascontiguousarray(messages[:, :4]).view("<f4")
        return np.asarray(step * messages[:, 4:].view(np.int8), np.float32)


def _bytes_of(rows: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> ImageArray:
    """Return the bytes of every row of numbers."""
    return np.ascontiguousarray(rows).view(np.uint8)
