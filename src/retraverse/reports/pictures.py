"""Thumbnails that travel inside the page: small JPEGs as data addresses, each at most once."""

import base64
import io
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from retraverse.errors import RetraverseError
from retraverse.types import ImageArray

__all__ = ["Picture", "PictureBook", "Pictures", "Side", "thumbnail"]

Side = Literal["query", "reference"]

_AREA = 44_000
"""Pixels of a thumbnail: 242 x 182 at 4:3, some 10 kB."""
_QUALITY = 68


class HasColour(Protocol):
    """A frame, as far as a report needs one."""

    def colour(self) -> ImageArray:
        """Return the picture, uint8 (height, width, 3) RGB."""
        ...


class Pictures(Protocol):
    """Frames by number: a `Traverse`, or any sequence of frames."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> HasColour: ...


@dataclass(frozen=True)
class Picture:
    """One thumbnail."""

    key: str
    """``"q12"``: query frame 12; ``"r7"``: reference frame 7."""
    uri: str
    """``data:image/jpeg;base64,...``"""
    width: int
    height: int
    readable: bool
    """False: the picture could not be read again, and this is a grey field in its place."""


@dataclass
class PictureBook:
    """Makes thumbnails when they are first asked for, and keeps them."""

    query: Pictures
    reference: Pictures
    pictures: dict[str, Picture] = field(default_factory=dict)
    """Every thumbnail made so far, by key."""

    @property
    def n_bytes(self) -> int:
        """Bytes all of them take in a page."""
        return sum(len(picture.uri) for picture in self.pictures.values())

    def get(self, side: Side, index: int) -> Picture:
        """Return the thumbnail of one frame."""
        key = f"{side[0]}{index}"
        if key not in self.pictures:
            frames = self.query if side == "query" else self.reference
            self.pictures[key] = _picture(frames, index, key)
        return self.pictures[key]


def _picture(frames: Pictures, index: int, key: str) -> Picture:
    try:
        pixels, readable = frames[index].colour(), True
    except (RetraverseError, OSError):  # a file moved since: the report matters more
        pixels, readable = np.full((90, 160, 3), 128, np.uint8), False
    jpeg, (width, height) = thumbnail(pixels)
    uri = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
    return Picture(key, uri, width, height, readable)


def thumbnail(pixels: ImageArray) -> tuple[bytes, tuple[int, int]]:
    """Return a picture as a small JPEG, and its width and height; small ones keep their size."""
    from PIL import Image

    image = Image.fromarray(pixels).convert("RGB")
    scale = min(1.0, (_AREA / (image.width * image.height)) ** 0.5)
    size = (max(1, round(image.width * scale)), max(1, round(image.height * scale)))
    buffer = io.BytesIO()
    image.resize(size, Image.Resampling.LANCZOS, reducing_gap=3).save(
        buffer, "JPEG", quality=_QUALITY, optimize=True
    )
    return buffer.getvalue(), size
