"""The byte form of a group of pictures: a head, then the packets of a video encoder.

Big endian: ``"GOP1"``, codec (1 byte), 1 if grey (1 byte), height, width, number of pictures (2
bytes each), then each packet after its length (3 bytes). What the packets say is the codec's
business; see `retraverse.images.codecs`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from retraverse.errors import InputError

__all__ = ["LONGEST_SIDE", "CodecName", "GroupHead", "join_group", "split_group"]

CodecName = Literal["h265", "av1"]
LONGEST_SIDE = 0xFFFF
"""The tallest and widest picture whose size the head can hold."""

_MAGIC = b"GOP1"
_HEAD_BYTES = 12
_LENGTH_BYTES = 3


@dataclass(frozen=True)
class GroupHead:
    """What a group says of itself."""

    codec: CodecName
    grey: bool
    height: int
    width: int
    n_pictures: int


def join_group(head: GroupHead, packets: Sequence[bytes]) -> bytes:
    """Return a head and packets as the bytes of a group."""
    kind = bytes([get_args(CodecName).index(head.codec), head.grey])
    numbers = (head.height, head.width, head.n_pictures)
    sizes = b"".join(number.to_bytes(2, "big") for number in numbers)
    sized = (len(packet).to_bytes(_LENGTH_BYTES, "big") + packet for packet in packets)
    return _MAGIC + kind + sizes + b"".join(sized)


def split_group(group: bytes) -> tuple[GroupHead, list[bytes]]:
    """Return the head and the packets of a group; the opposite of `join_group`.

    Raises
    ------
    InputError
        If the bytes are no group, or truncated.
    """
    return _read_head(group), _read_packets(group)


def _read_head(group: bytes) -> GroupHead:
    names = get_args(CodecName)
    if len(group) < _HEAD_BYTES or not group.startswith(_MAGIC) or group[4] >= len(names):
        raise InputError("group of pictures: these bytes are no group of this program's")
    height, width, n_pictures = (int.from_bytes(group[i : i + 2], "big") for i in (6, 8, 10))
    return GroupHead(names[group[4]], bool(group[5]), height, width, n_pictures)


def _read_packets(group: bytes) -> list[bytes]:
    packets, position = [], _HEAD_BYTES
    while position < len(group):
        start = position + _LENGTH_BYTES
        length = int.from_bytes(group[position:start], "big")
        packet = group[start : start + length]
        if not length or len(packet) != length:
            raise InputError("group of pictures: truncated")
        packets.append(packet)
        position = start + length
    return packets
