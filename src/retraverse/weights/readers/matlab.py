"""MATLAB's ``.mat`` files of version 5 (MATLAB 5 to 7.2, and ``-v7``), read without MATLAB.

Names: fields of structs joined by dots, cells and arrays of structs by a number from 0 in
MATLAB's order: ``net.layers.3.weights.0``. Shapes are MATLAB's, so a row of five is (1, 5). Texts
go to the metadata; empty arrays and function handles are left out.

Source: MathWorks, "MAT-File Format", version 5 (chapter 1, "Level 5 MAT-Files").
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import Budget, reading, whole_content
from retraverse.weights.weight_file import WeightFile

__all__ = ["parse_matlab", "read", "recognise"]

_HEADER_BYTES = 128
_GROWTH = 200
_DEEPEST = 32
_MATRIX, _COMPRESSED = 14, 15
_element_types = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
    16: "u1",
    17: "u2",
    18: "u4",
}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_class_types = {
    6: "f8",
    7: "f4",
    8: "i1",
    9: "u1",
    10: "i2",
    11: "u2",
    12: "i4",
    13: "u4",
    14: "i8",
    15: "u8",
}
_COMPLEX, _LOGICAL = 8, 2


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file has the header of a version 5 MAT-file."""
    return head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def read(path: Path) -> WeightFile:
    """Read the arrays of a version 5 MAT-file.

    Raises
    ------
    InputError
        If the file is damaged, or holds sparse or complex arrays.
    """
    with reading(path, "a MATLAB file"):
        return parse_matlab(whole_content(path))


def parse_matlab(content: memoryview) -> WeightFile:
    """Return what `read` returns from a file's bytes.

    Raises
    ------
    ValueError
        If they are no version 5 MAT-file.
    """
    order: Literal["<", ">"] = "<" if bytes(content[126:128]) == b"IM" else ">"
    reader = _Reader(order, Budget(len(content), _GROWTH))
    body = content[_HEADER_BYTES:]
    for kind, element in reader.elements(body):
        if kind == _COMPRESSED:
            inner = reader.decompressed(element)
            kind, element = next(reader.elements(inner))
        if kind != _MATRIX:
            raise ValueError(f"it holds an element of type {kind}, expected arrays")
        reader.matrix(element, prefix="", depth=0)
    if not reader.tensors:
        raise ValueError("it holds no arrays of numbers")
    return WeightFile(reader.tensors, reader.texts, "matlab")


@dataclass(frozen=True)
class _Matrix:
    kind: int
    flags: int
    shape: tuple[int, ...]
    name: str
    rest: "Iterator[tuple[int, memoryview]]"


class _Reader:
    """Collects arrays and texts under their full names."""

    def __init__(self, order: Literal["<", ">"], budget: Budget) -> None:
        self._order: Literal["<", ">"] = order
        self._budget = budget
        self.tensors: dict[str, Array] = {}
        self.texts: dict[str, str] = {}

    def elements(self, content: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Yield type and content of a row of elements."""
        place = 0
        while place < len(content):
            kind, size = struct.unpack_from(f"{self._order}II", content, place)
            start, padded = place + 8, 8 + size + (-size % 8)
            if kind >> 16:  # Up to four bytes fit into the tag itself.
                kind, size, start, padded = kind & 0xFFFF, kind >> 16, place + 4, 8
            if size > len(content) - start or (start == place + 4 and size > 4):
                raise ValueError(f"an element claims {size} bytes of {len(content) - start}")
            yield kind, content[start : start + size]
            place += 8 + size if kind == _COMPRESSED else padded

    def decompressed(self, content: memoryview) -> memoryview:
        """Return a compressed element's content, within the budget."""
        unpacker, parts = zlib.decompressobj(), []
        rest = bytes(content)
        while rest and not unpacker.eof:
            parts.append(unpacker.decompress(rest, 1 << 20))
            self._budget.spend(len(parts[-1]))
            rest = unpacker.unconsumed_tail
        if not unpacker.eof:
            raise ValueError("a compressed array is cut off")
        return memoryview(b"".join(parts))

    def matrix(self, content: memoryview, prefix: str, depth: int) -> None:
        """Collect one array with everything in it."""
        if depth > _DEEPEST:
            raise ValueError(f"arrays lie more than {_DEEPEST} deep")
        if not content:
            return
        matrix = self._header(content)
        # Inside of others, arrays have no name of their own.
        name = prefix or matrix.name
        if matrix.kind == _CELL:
            for i, inner in enumerate(self._inner(matrix, math.prod(matrix.shape))):
                self.matrix(inner, f"{name}.{i}", depth + 1)
        elif matrix.kind in (_STRUCT, _OBJECT):
            self._struct(matrix, name, depth)
        elif matrix.kind == _CHAR:
            self._text(matrix, name)
        elif matrix.kind == _SPARSE:
            raise ValueError(f"{name!r} is a sparse array, which is not read")
        elif matrix.kind in _class_types:
            self._numbers(matrix, name)

    def _header(self, content: memoryview) -> _Matrix:
        rest = self.elements(content)
        flags = self._values(*next(rest))
        shape = tuple(self._values(*next(rest)).tolist())
        if not shape or min(shape) < 0 or math.prod(shape) > 1 << 40:
            raise ValueError(f"an array has the shape {shape}")
        name = bytes(next(rest)[1]).decode("latin-1")
        kind, bits = int(flags[0]) & 0xFF, int(flags[0]) >> 8 & 0xFF
        return _Matrix(kind, bits, shape, name, rest)

    def _values(self, kind: int, content: memoryview) -> Array:
        if kind not in _element_types:
            raise ValueError(f"an array's part has the type {kind}")
        return np.frombuffer(content, np.dtype(_element_types[kind]).newbyteorder(self._order))

    def _inner(self, matrix: _Matrix, count: int) -> Iterator[memoryview]:
        found = 0
        for kind, content in matrix.rest:
            if kind != _MATRIX or found == count:
                raise ValueError("an array of arrays holds something else")
            found += 1
            yield content
        if found != count:
            raise ValueError(f"an array of arrays holds {found} of {count}")

    def _struct(self, matrix: _Matrix, name: str, depth: int) -> None:
        if matrix.kind == _OBJECT:
            next(matrix.rest)  # The class's name.
        width = int(self._values(*next(matrix.rest))[0])
        packed = bytes(next(matrix.rest)[1])
        if width < 1 or len(packed) % width:
            raise ValueError("a struct's field names are damaged")
        starts = range(0, len(packed), width)
        fields = [packed[i : i + width].split(b"\0")[0].decode("latin-1") for i in starts]
        count = math.prod(matrix.shape)
        for i, inner in enumerate(self._inner(matrix, count * len(fields))):
            number = f".{i // len(fields)}" if count != 1 else ""
            self.matrix(inner, f"{name}{number}.{fields[i % len(fields)]}", depth + 1)

    def _text(self, matrix: _Matrix, name: str) -> None:
        kind, content = next(matrix.rest, (2, memoryview(b"")))
        codes = self._values(kind, content).astype(np.int64)
        if codes.size and codes.max() > 0x10FFFF:
            raise ValueError(f"the text {name!r} is damaged")
        self._put(self.texts, name, "".join(map(chr, codes.tolist())))

    def _numbers(self, matrix: _Matrix, name: str) -> None:
        if matrix.flags & _COMPLEX:
            raise ValueError(f"{name!r} is complex, which is not read")
        if 0 in matrix.shape:
            return
        # Numbers are stored in the narrowest type that holds them all.
        stored = self._values(*next(matrix.rest))
        if stored.size != math.prod(matrix.shape):
            raise ValueError(f"{name!r} of shape {matrix.shape} has {stored.size} values")
        dtype = np.dtype("?" if matrix.flags & _LOGICAL else _class_types[matrix.kind])
        self._budget.spend(stored.size * dtype.itemsize)
        values = stored.astype(dtype).reshape(matrix.shape, order="F")
        self._put(self.tensors, name, np.ascontiguousarray(values))

    def _put(self, table: dict[str, Array] | dict[str, str], name: str, value: object) -> None:
        if name in table:
            raise ValueError(f"the name {name[:80]!r} comes twice")
        table[name] = value  # type: ignore[assignment]
