"""JPEG files without the tables that all files of one encoder share.

About 600 bytes of a colour JPEG are the same in every file of one encoder and quality:
quantisation tables, Huffman tables, the JFIF mark. Two robots can agree on them once. What is
left of a file is a key (which tables), the picture's size, and its pixels.

Form of a bare picture, big endian::

    1 byte    0xB1, or 0xB2 if the Huffman tables are the picture's own (`optimize`) and stay
    4 bytes   key: the beginning of the SHA-256 of the header's template
    4 bytes   height and width
    (0xB2)    each Huffman segment: its length in 2 bytes (itself counted), its content
    the rest  entropy-coded data as in the file, without the end mark

Conventions
- A header is everything of a file up to and with the first scan's parameters. In its *template*
  the picture's size is 0, and in a template for 0xB2 the Huffman segments are empty.
- What is no JPEG this module follows to the byte, or whose header the `TableSet` does not hold, is
  passed on unharmed; it grows by one byte (0xB0) only where it began like a bare picture.
  `restore_tables` gives back exactly the bytes that went in.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from retraverse.errors import InputError
from retraverse.images.jpeg import Encoder, encode_jpeg

__all__ = ["TableSet", "restore_tables", "strip_tables"]

_AS_IT_IS, _BARE, _BARE_OWN_HUFFMAN = b"\xb0", b"\xb1", b"\xb2"
_KEY_BYTES = 4
_SIZE_BYTES = 4

_START, _END = b"\xff\xd8", b"\xff\xd9"
_SCAN, _HUFFMAN = 0xDA, 0xC4
# Frame headers: baseline, extended and progressive; the rest nobody writes.
_FRAMES = frozenset({0xC0, 0xC1, 0xC2})
_EMPTY_HUFFMAN = b"\xff\xc4\x00\x00"
_SET_MAGIC = b"retraverse JPEG tables 1\n"


@dataclass(frozen=True)
class TableSet:
    """The headers two sides have agreed on; grows by joining, ``one | other``."""

    templates: frozenset[bytes]
    """Headers of files without the picture's size; see the module's head."""
    _by_key: dict[bytes, bytes] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Index the templates by key."""
        object.__setattr__(self, "_by_key", {_key(one): one for one in self.templates})

    def __or__(self, other: "TableSet") -> "TableSet":
        return TableSet(self.templates | other.templates)

    @classmethod
    def for_encoder(
        cls, encoder: Encoder | None = None, compressions: Iterable[int] = range(100)
    ) -> "TableSet":
        """Return the tables of an encoder, grey and colour, at these compressions.

        Both sides can call this instead of sending the set.
        """
        encoder = encoder or Encoder()
        pictures = (np.zeros((8, 8), np.uint8), np.zeros((8, 8, 3), np.uint8))
        return cls.learned_from(
            encode_jpeg(picture, c, encoder) for c in compressions for picture in pictures
        )

    @classmethod
    def learned_from(cls, jpegs: Iterable[bytes]) -> "TableSet":
        """Return the tables of these files, whoever wrote them; what is no JPEG adds none."""
        headers = [header for header in map(_read_header, jpegs) if header is not None]
        return cls(
            frozenset(
                template
                for header in headers
                for template in (header.template, header.template_without_huffman)
            )
        )

    def find(self, key: bytes) -> bytes | None:
        """Return the template of a key, None if this set does not hold it."""
        return self._by_key.get(key)

    def to_bytes(self) -> bytes:
        """Return the set as bytes to send once; equal sets give equal bytes."""
        parts = [len(one).to_bytes(4, "big") + one for one in sorted(self.templates)]
        body = b"".join(parts)
        return _SET_MAGIC + hashlib.sha256(body).digest() + body

    @classmethod
    def from_bytes(cls, content: bytes) -> "TableSet":
        """Return the set that `to_bytes` wrote.

        Raises
        ------
        InputError
            If the bytes are no such set, or damaged.
        """
        start = len(_SET_MAGIC) + 32
        body = content[start:]
        if not content.startswith(_SET_MAGIC):
            raise InputError("JPEG tables: these bytes are no table set of this program's")
        if content[len(_SET_MAGIC) : start] != hashlib.sha256(body).digest():
            raise InputError("JPEG tables: damaged or truncated, the checksum does not fit")
        templates = []
        while body:
            end = 4 + int.from_bytes(body[:4], "big")
            templates.append(body[4:end])
            body = body[end:]
        return cls(frozenset(templates))


def strip_tables(jpeg: bytes, tables: TableSet) -> bytes:
    """Return a JPEG file as a bare picture, or unharmed if its tables are not in the set.

    Parameters
    ----------
    jpeg : bytes
        Any bytes at all; only JPEG files with known tables become smaller.
    tables : TableSet
        The other side needs the same templates.
    """
    header = _read_header(jpeg)
    if header is not None and jpeg.endswith(_END) and len(jpeg) >= header.end + len(_END):
        pixels = jpeg[header.end : -len(_END)]
        for mark, template, extra in (
            (_BARE, header.template, b""),
            (_BARE_OWN_HUFFMAN, header.template_without_huffman, header.huffman),
        ):
            if tables.find(_key(template)) == template:
                return mark + _key(template) + header.size + extra + pixels
    return _AS_IT_IS + jpeg if jpeg[:1] in (_AS_IT_IS, _BARE, _BARE_OWN_HUFFMAN) else jpeg


def restore_tables(bare: bytes, tables: TableSet) -> bytes:
    """Return the file that `strip_tables` was given, byte for byte.

    Damage to the pixels cannot be seen here: the file comes back and its decoder complains.

    Raises
    ------
    InputError
        If the bare picture is truncated or its tables are not in the set.
    """
    mark = bare[:1]
    if mark == _AS_IT_IS:
        return bare[1:]
    if mark not in (_BARE, _BARE_OWN_HUFFMAN) or not mark:
        return bare
    key, rest = bare[1 : 1 + _KEY_BYTES], bare[1 + _KEY_BYTES :]
    if len(rest) < _SIZE_BYTES:
        raise InputError(f"bare JPEG picture: truncated, only {len(bare)} bytes")
    template = tables.find(key)
    if template is None:
        raise InputError(
            f"bare JPEG picture: its tables ({key.hex()}) are not among the "
            f"{len(tables.templates)} known here (another encoder, or damaged?)"
        )
    size, rest = rest[:_SIZE_BYTES], rest[_SIZE_BYTES:]
    if mark == _BARE_OWN_HUFFMAN:
        template, rest = _fill_huffman(template, rest)
    place = _size_place(template)
    return template[:place] + size + template[place + _SIZE_BYTES :] + rest + _END


@dataclass(frozen=True)
class _Header:
    """A file's header taken apart."""

    template: bytes
    template_without_huffman: bytes
    huffman: bytes
    """The Huffman segments without their markers."""
    size: bytes
    """Height and width."""
    end: int
    """Where the entropy-coded data begin."""


def _read_header(jpeg: bytes) -> _Header | None:
    """Return the header of a JPEG file, None if it is anything out of the ordinary."""
    segments = _segments(jpeg) or []
    frames = [segment for segment in segments if segment[1] in _FRAMES]
    if len(frames) != 1 or len(frames[0]) < 9:
        return None
    full, without, huffman = [_START], [_START], []
    for segment in segments:
        if segment[1] == _HUFFMAN:
            full.append(segment)
            without.append(_EMPTY_HUFFMAN)
            huffman.append(segment[2:])
        else:
            # A frame header: marker, length, precision, then height and width.
            blank = segment[:5] + bytes(_SIZE_BYTES) + segment[9:]
            kept = blank if segment[1] in _FRAMES else segment
            full.append(kept)
            without.append(kept)
    end = len(_START) + sum(map(len, segments))
    return _Header(b"".join(full), b"".join(without), b"".join(huffman), frames[0][5:9], end)


def _segments(jpeg: bytes) -> list[bytes] | None:
    """Return the segments after the start mark up to the first scan's, None if broken."""
    if not jpeg.startswith(_START):
        return None
    found, position = [], len(_START)
    while True:
        length = int.from_bytes(jpeg[position + 2 : position + 4], "big")
        segment = jpeg[position : position + 2 + length]
        if length < 2 or len(segment) != 2 + length or segment[0] != 0xFF:
            return None
        found.append(segment)
        position += len(segment)
        if segment[1] == _SCAN:
            return found


def _fill_huffman(template: bytes, rest: bytes) -> tuple[bytes, bytes]:
    """Put Huffman segments back into a template; return it and what follows them."""
    filled, position = [_START], len(_START)
    while position < len(template):
        if template.startswith(_EMPTY_HUFFMAN, position):
            length = int.from_bytes(rest[:2], "big")
            if length < 2 or len(rest) < length:
                raise InputError("bare JPEG picture: truncated or damaged in its Huffman tables")
            filled.append(b"\xff\xc4" + rest[:length])
            rest = rest[length:]
            position += len(_EMPTY_HUFFMAN)
        else:
            end = position + 2 + int.from_bytes(template[position + 2 : position + 4], "big")
            filled.append(template[position:end])
            position = end
    return b"".join(filled), rest


def _size_place(header: bytes) -> int:
    """Return where height and width stand in a header."""
    position = len(_START)
    while header[position + 1] not in _FRAMES:
        position += 2 + int.from_bytes(header[position + 2 : position + 4], "big")
    return position + 5


def _key(template: bytes) -> bytes:
    return hashlib.sha256(template).digest()[:_KEY_BYTES]
