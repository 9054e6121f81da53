"""Protocol Buffers on the wire, without their compiler: messages as numbered fields.

A message is a row of fields, each a tag (number and wire type) and a value: a variable-length
integer, 4 or 8 bytes, or a length and that many bytes. Those are texts, inner messages or packed
numbers; which, the schema knows, so the caller asks by number and kind. Numbers may come packed,
one by one, or mixed.

Source: Protocol Buffers documentation, "Encoding".
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import DTypeLike

from retraverse.types import Array, IntArray

__all__ = ["Message", "Value"]

Value = int | memoryview
"""Integers of wire type 0; everything else as its bytes."""

_VARINT, _EIGHT_BYTES, _LENGTH, _FOUR_BYTES = 0, 1, 2, 5


class Message:
    """The fields of one message, read at once; inner messages only when asked for.

    Parameters
    ----------
    content : memoryview
        The message's bytes.

    Raises
    ------
    ValueError
        If they are no message.
    """

    def __init__(self, content: memoryview) -> None:
        self._fields: dict[int, list[Value]] = {}
        for number, value in _fields(content):
            self._fields.setdefault(number, []).append(value)

    def __contains__(self, number: int) -> bool:
        return number in self._fields

    def numbers(self) -> set[int]:
        """Return the numbers of the fields that are there."""
        return set(self._fields)

    def content(self, number: int) -> memoryview:
        """Return the bytes of a field, the last one if it comes several times; none = empty."""
        values = self._of_length(number)
        return values[-1] if values else memoryview(b"")

    def text(self, number: int) -> str:
        """Return a text field; left out = empty."""
        return bytes(self.content(number)).decode("utf-8")

    def texts(self, number: int) -> list[str]:
        """Return a repeated text field."""
        return [bytes(value).decode("utf-8") for value in self._of_length(number)]

    def messages(self, number: int) -> list["Message"]:
        """Return a repeated field of inner messages."""
        return [Message(value) for value in self._of_length(number)]

    def message(self, number: int) -> "Message":
        """Return a field's inner message; left out = one without fields."""
        return Message(self.content(number))

    def integer(self, number: int, default: int = 0) -> int:
        """Return an integer field (of wire type 0, as signed 64 bits)."""
        values = self._fields.get(number, [default])
        if not isinstance(values[-1], int):
            raise ValueError(f"field {number} is no integer")
        return values[-1]

    def integers(self, number: int) -> IntArray:
        """Return a repeated integer field."""
        numbers: list[int] = []
        for value in self._fields.get(number, []):
            numbers += [value] if isinstance(value, int) else _varints(value)
        return np.array(numbers, np.int64)

    def reals(self, number: int, dtype: DTypeLike) -> Array:
        """Return a repeated field of float32 or float64 numbers, as a copy."""
        values = [value for value in self._fields.get(number, []) if isinstance(value, memoryview)]
        if len(values) != len(self._fields.get(number, [])):
            raise ValueError(f"field {number} holds integers, expected reals")
        content = values[0] if len(values) == 1 else b"".join(values)
        little = np.dtype(dtype).newbyteorder("<")
        return np.frombuffer(content, little).astype(dtype)

    def _of_length(self, number: int) -> list[memoryview]:
        values = self._fields.get(number, [])
        wanted = [value for value in values if isinstance(value, memoryview)]
        if len(wanted) != len(values):
            raise ValueError(f"field {number} is an integer, expected text or a message")
        return wanted


def _fields(content: memoryview) -> Iterator[tuple[int, Value]]:
    place, end = 0, len(content)
    while place < end:
        tag, place = _varint(content, place)
        number, wire = tag >> 3, tag & 7
        if not 0 < number < 1 << 29:
            raise ValueError(f"a field has the number {number}")
        if wire == _VARINT:
            value, place = _varint(content, place)
            yield number, value
            continue
        size, place = _size(content, place, wire)
        if not 0 <= size <= end - place:
            raise ValueError(f"field {number} claims {size} bytes of {end - place} that are left")
        yield number, content[place : place + size]
        place += size


def _size(content: memoryview, place: int, wire: int) -> tuple[int, int]:
    if wire == _LENGTH:
        return _varint(content, place)
    if wire == _FOUR_BYTES:
        return 4, place
    if wire == _EIGHT_BYTES:
        return 8, place
    raise ValueError(f"a field has the wire type {wire}")


def _varint(content: memoryview, place: int) -> tuple[int, int]:
    """Return the integer at `place`, seven bits a byte, and where it ends."""
    number = 0
    for shift in range(0, 70, 7):
        if place >= len(content):
            raise ValueError("it ends within a number")
        byte = content[place]
        place += 1
        number |= (byte & 127) << shift
        if byte < 128:
            # Two's complement of 64 bits: negative numbers take ten bytes.
            number &= (1 << 64) - 1
            return number - (1 << 64) if number >> 63 else number, place
    raise ValueError("a number has more than ten bytes")


def _varints(content: memoryview) -> list[int]:
    numbers, place = [], 0
    while place < len(content):
        number, place = _varint(content, place)
        numbers.append(number)
    return numbers
