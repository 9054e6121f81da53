"""Byte strings of many lengths in two plain arrays: names, pictures.

All strings end to end are the *text*; ``ends[i]`` says where string i stops.
"""

from collections.abc import Sequence

import numpy as np

from retraverse.errors import MapError
from retraverse.types import Array

__all__ = ["check_ragged", "pack", "unpack"]


def pack(strings: Sequence[bytes]) -> tuple[Array, Array]:
    """Return `strings` as uint8 (bytes,) end to end, and int64 (N,) ends."""
    text = np.frombuffer(b"".join(strings), np.uint8)
    ends = np.cumsum([len(string) for string in strings], dtype=np.int64)
    return text, ends


def unpack(text: Array, ends: Array, index: int) -> bytes:
    """Return string `index`."""
    start = ends[index - 1] if index else 0
    return text[start : ends[index]].tobytes()


def check_ragged(text: Array, ends: Array, what: str) -> None:
    """Refuse ends that do not rise from 0 to the length of the text.

    Raises
    ------
    MapError
        Naming `what`.
    """
    steps = np.diff(ends, prepend=0)
    if (steps < 0).any() or (ends[-1] if len(ends) else 0) != len(text):
        raise MapError(f"{what}: its ends do not fit its {len(text)} bytes; the file is damaged")
