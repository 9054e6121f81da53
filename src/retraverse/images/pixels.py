"""Where the pixels of a frame come from: a file, or an array. Videos have their own module.

Nothing is kept: every call reads or asks again, so a traverse of any length fits in memory.
Errors give the reason only; `Frame` puts the name of the picture before it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from retraverse.errors import FrameReadError
from retraverse.images.decode import (
    ColourOrder,
    GreyPath,
    check_array,
    decode_bgr,
    decode_grey,
    to_grey,
    to_rgb,
)
from retraverse.types import ImageArray

__all__ = ["ArrayPixels", "ArraySequence", "FilePixels", "Pixels", "read_bytes"]


class Pixels(Protocol):
    """What a `Frame` needs of its source. Thread-safe."""

    def encoded(self) -> bytes | None:
        """Return the bytes of the picture file, None where there is no such file."""
        ...

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width)."""
        ...

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        ...

    def fingerprint(self) -> bytes:
        """Return bytes that differ where the pixels do, for hashing."""
        ...


class ArraySequence(Protocol):
    """Anything with a length that gives an array for each number below it, when asked."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Any: ...


@dataclass(frozen=True, slots=True)
class FilePixels:
    """A picture file, read and decoded anew each time."""

    path: Path

    def encoded(self) -> bytes:
        """Return the bytes of the file as they are."""
        return read_bytes(self.path)

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width) by one of the two grey paths."""
        return decode_grey(self.encoded(), path)

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        return to_rgb(decode_bgr(self.encoded()), "bgr")

    def fingerprint(self) -> bytes:
        """Return the bytes of the file."""
        return self.encoded()


@dataclass(frozen=True, slots=True)
class ArrayPixels:
    """One item of a sequence of arrays, asked for only when its pixels are wanted.

    An array has no decoder of its own, so both grey paths convert its colours.
    """

    items: ArraySequence
    position: int
    colour_order: ColourOrder

    def encoded(self) -> None:
        """Return None: an array was never a file."""
        return None

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width); `path` makes no difference."""
        return to_grey(check_array(self.items[self.position]), self.colour_order)

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        return to_rgb(check_array(self.items[self.position]), self.colour_order)

    def fingerprint(self) -> bytes:
        """Return shape, channel order and the 8-bit values."""
        picture = check_array(self.items[self.position])
        return f"{picture.shape}{self.colour_order}".encode() + picture.tobytes()


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    FrameReadError
        With the reason, without the name.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise FrameReadError("no such file (or gone since it was listed)") from error
    except IsADirectoryError as error:
        raise FrameReadError("a folder, not a picture") from error
    except PermissionError as error:
        raise FrameReadError("permission denied") from error
    except OSError as error:
        raise FrameReadError(error.strerror or str(error)) from error
