"""FlatBuffers and FlexBuffers, as far as TensorFlow Lite files need them. Every step is checked.

A flatbuffer table starts with the distance back to its field list, which says where, from the
table's start, each field lies (0 = left out). Tables, vectors and texts lie elsewhere: their
fields hold the distance forward. FlexBuffers need no schema: each value has a type byte.

Source: the FlatBuffers project's "Internals" and "FlexBuffers" format descriptions.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import DTypeLike

from retraverse.types import Array

__all__ = ["FlexValue", "Table", "read_flex_map", "root_table"]

FlexValue = int | float | str | bool | None


@dataclass(frozen=True)
class Table:
    """One table of a flatbuffer; fields are numbered from 0 in their schema's order."""

    content: memoryview
    position: int

    @classmethod
    def _at(cls, content: memoryview, position: int) -> Self:
        if not 0 < position < len(content):
            raise ValueError(f"a table lies at byte {position} of {len(content)}")
        return cls(content, position)

    def _field(self, index: int) -> int | None:
        fields = self.position - _unpack("<i", self.content, self.position)
        if 4 + 2 * index >= _unpack("<H", self.content, fields):
            return None
        distance = _unpack("<H", self.content, fields + 4 + 2 * index)
        return self.position + distance if distance else None

    def _target(self, index: int) -> int | None:
        place = self._field(index)
        return None if place is None else place + _unpack("<I", self.content, place)

    def integer(self, index: int, code: str, default: int = 0) -> int:
        """Return an integer field; `code` is that of the module struct, as in ``"i"``."""
        place = self._field(index)
        return default if place is None else _unpack("<" + code, self.content, place)

    def real(self, index: int, default: float = 0.0) -> float:
        """Return a float32 field."""
        place = self._field(index)
        if place is None:
            return default
        number: float = struct.unpack_from("<f", self.content, place)[0]
        return number

    def text(self, index: int) -> str:
        """Return a text field; left out = empty."""
        return bytes(self.vector(index, np.uint8)).decode("utf-8")

    def vector(self, index: int, dtype: DTypeLike) -> Array:
        """Return a vector of numbers as a view; left out = empty."""
        place = self._target(index)
        little = np.dtype(dtype).newbyteorder("<")
        if place is None:
            return np.empty(0, little)
        length = _unpack("<I", self.content, place)
        return np.frombuffer(self.content, little, length, place + 4)

    def table(self, index: int) -> "Table | None":
        """Return a table field, None if left out."""
        place = self._target(index)
        return None if place is None else self._at(self.content, place)

    def tables(self, index: int) -> list["Table"]:
        """Return a vector of tables; left out = empty."""
        offsets = self.vector(index, np.uint32)
        first = (self._target(index) or 0) + 4
        places = (first + 4 * i + int(offset) for i, offset in enumerate(offsets))
        return [self._at(self.content, place) for place in places]


def root_table(content: memoryview) -> Table:
    """Return the table a flatbuffer starts from."""
    return Table._at(content, _unpack("<I", content, 0))


def _unpack(code: str, content: memoryview, place: int) -> int:
    if place < 0:
        raise ValueError(f"it points to byte {place}")
    number: int = struct.unpack_from(code, content, place)[0]
    return number


def read_flex_map(content: bytes) -> Mapping[str, FlexValue]:
    """Return a flexbuffer whose root is a map of plain values.

    Raises
    ------
    ValueError, struct.error
        If it is something else.
    """
    if len(content) < 3:
        raise ValueError("a flexbuffer is cut off")
    view, width, kind = memoryview(content), content[-1], content[-2]
    if kind >> 2 != _MAP:
        raise ValueError("a flexbuffer is no map")
    start = _followed(view, len(content) - 2 - width, width)
    return _flex_map(view, start, 1 << (kind & 3))


def _flex_map(view: memoryview, start: int, width: int) -> dict[str, FlexValue]:
    # Before the values: distance to the keys, width of the keys, number of both.
    count = _unpack(_unsigned[width], view, start - width)
    keys = _followed(view, start - 3 * width, width)
    key_width = _unpack(_unsigned[width], view, start - 2 * width)
    if count * (width + 1) > len(view):
        raise ValueError(f"a flexbuffer of {len(view)} bytes claims {count} values")
    names = (
        _flex_key(view, _followed(view, keys + i * key_width, key_width)) for i in range(count)
    )
    kinds = bytes(view[start + count * width : start + count * (width + 1)])
    values = (_flex_value(view, start + i * width, width, kinds[i]) for i in range(count))
    return dict(zip(names, values, strict=True))


def _flex_key(view: memoryview, start: int) -> str:
    text = bytes(view[start:])
    return text[: text.index(0)].decode("utf-8")


def _flex_value(view: memoryview, place: int, width: int, kind: int) -> FlexValue:
    family, inner_width = kind >> 2, 1 << (kind & 3)
    if family == _NULL:
        return None
    if family == _BOOL:
        return bool(_unpack(_unsigned[width], view, place))
    if family in _number_codes:
        return _number(_number_codes[family], width, view, place)
    if family in _indirect_codes:
        start = _followed(view, place, width)
        return _number(_indirect_codes[family], inner_width, view, start)
    if family == _KEY:
        return _flex_key(view, _followed(view, place, width))
    if family == _STRING:
        start = _followed(view, place, width)
        length = _unpack(_unsigned[inner_width], view, start - inner_width)
        return bytes(view[start : start + length]).decode("utf-8")
    raise ValueError(f"a flexbuffer holds a value of type {family}, expected plain ones")


def _followed(view: memoryview, place: int, width: int) -> int:
    target = place - _unpack(_unsigned[width], view, place)
    if target < 0:
        raise ValueError("a flexbuffer points before its start")
    return target


def _number(codes: Mapping[int, str], width: int, view: memoryview, place: int) -> int | float:
    if place < 0:
        raise ValueError("a flexbuffer points before its start")
    number: int | float = struct.unpack_from(codes[width], view, place)[0]
    return number


_NULL, _KEY, _STRING, _MAP, _BOOL = 0, 4, 5, 9, 26
_signed = {1: "<b", 2: "<h", 4: "<i", 8: "<q"}
_unsigned = {1: "<B", 2: "<H", 4: "<I", 8: "<Q"}
_reals = {2: "<e", 4: "<f", 8: "<d"}
_number_codes = {1: _signed, 2: _unsigned, 3: _reals}
_indirect_codes = {6: _signed, 7: _unsigned, 8: _reals}
