"""What is done to the pictures of a drive, as a value: size, compression, one part of it, video.

Conventions
- Order: decode, resize, compress. What is compressed are the pixels OpenCV decodes; each c
  starts from them, never from another c's result.
- ``compression=None`` leaves the picture's own bytes alone (c = 0 of chapter 5); ``0`` is JPEG of
  quality 100 (c = 0 of chapter 6, where pictures were resized first).
- Two equal labels mean the same pictures; a fingerprint also names the libraries' versions.
"""

import hashlib
from dataclasses import dataclass, field
from typing import Literal, get_args

from retraverse.errors import ConfigError
from retraverse.images.codecs import (
    GROUP_CODECS,
    LONGEST_GROUP,
    CodecName,
    check_quality,
    codec_versions,
)
from retraverse.images.jpeg import Encoder, JpegLibrary, check_compression, encoder_versions
from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.registry import unknown_name

__all__ = ["Resizer", "VideoGroups", "Worsening"]

Resizer = Literal["pillow", "opencv"]
"""``pillow``: `Image.resize` with its default filter, bicubic with antialiasing (chapter 7);
``opencv``: `cv2.resize` with its default, bilinear without antialiasing (chapter 6)."""
_FILTERS: dict[str, str] = {"pillow": "bicubic", "opencv": "bilinear"}
LARGEST_SIDE = 16384


@dataclass(frozen=True)
class VideoGroups:
    """Consecutive pictures sent as groups of a video codec, each group on its own."""

    codec: CodecName = "av1"
    quality: int = 35
    """Constant rate factor, 0 to 51 (H.265) or 1 to 63 (AV1): larger is coarser."""
    length: int = 8
    """Pictures a group, counted from the first frame; the last group may be shorter."""

    def __post_init__(self) -> None:
        """Check every range."""
        if self.codec not in GROUP_CODECS:
            raise ConfigError(unknown_name("video codec", self.codec, list(GROUP_CODECS)))
        check_quality(GROUP_CODECS[self.codec], self.quality)
        if not 1 <= self.length <= LONGEST_GROUP:
            raise ConfigError(f"pictures a group: got {self.length}, expected 1 to {LONGEST_GROUP}")

    @property
    def label(self) -> str:
        """Codec, quality, length and the encoder's settings in words."""
        settings = GROUP_CODECS[self.codec].label
        return f"{self.codec} crf {self.quality} in groups of {self.length} by {settings}"


@dataclass(frozen=True)
class Worsening:
    """What is done to every picture of a drive."""

    resize: int | None = None
    """Side of the square in pixels, whatever the picture's shape was; None = as it is."""
    resizer: Resizer = "pillow"
    """Whose resizing; no matter without `resize`."""
    compression: int | None = None
    """c of the thesis, 0 to 99 (JPEG quality 100 - c); None = not encoded."""
    encoder: Encoder = field(default_factory=Encoder)
    """How the JPEG is written; no matter without `compression`."""
    part: str = ""
    """Which part of JPEG's damage is done, a name of `JPEG_PARTS`; "" = all of it, as a file."""
    video: VideoGroups | None = None
    """Groups of a video codec in place of JPEG files."""

    def __post_init__(self) -> None:
        """Check every range."""
        if self.resize is not None and not 1 <= self.resize <= LARGEST_SIDE:
            raise ConfigError(f"resize: got {self.resize}, expected 1 to {LARGEST_SIDE} pixels")
        if self.resizer not in get_args(Resizer):
            raise ConfigError(
                f"resizer: got {self.resizer!r}, expected one of {', '.join(get_args(Resizer))}"
            )
        if self.compression is not None:
            check_compression(self.compression)
        if self.part:
            self._check_part()
        if self.video is not None and self.compression is not None:
            raise ConfigError("video: got a compression, too; expected JPEG files or groups")

    def _check_part(self) -> None:
        if self.part not in JPEG_PARTS:
            raise ConfigError(unknown_name("part of JPEG", self.part, list(JPEG_PARTS)))
        if self.compression is None:
            raise ConfigError(
                f"part of JPEG {self.part!r}: got no compression, expected the c whose damage it is"
            )

    @property
    def is_nothing(self) -> bool:
        """Whether pictures stay as they are."""
        return self.resize is None and self.compression is None and self.video is None

    @property
    def is_file(self) -> bool:
        """Whether each picture becomes a JPEG file of its own."""
        return self.compression is not None and not self.part

    @property
    def label(self) -> str:
        """What is done, in words, for records: two equal labels mean the same pictures."""
        words = []
        if self.resize is not None:
            words.append(f"resized to {self.resize} px by {self.resizer_label}")
        if self.compression is not None:
            part = f"{self.part} of " if self.part else ""
            words.append(f"{part}JPEG c = {self.compression} by {self.encoder.label}")
        if self.video is not None:
            words.append(self.video.label)
        return ", ".join(words) or "as it is"

    @property
    def resizer_label(self) -> str:
        """Library and filter: ``"pillow bicubic"``; empty without resizing."""
        return f"{self.resizer} {_FILTERS[self.resizer]}" if self.resize is not None else ""

    def fingerprint(self, original: bytes) -> bytes:
        """Return what identifies the result, from the fingerprint of the original frame.

        Library versions count: the same options may give other bytes by another version.
        """
        if self.is_nothing:
            return original
        versions = ", ".join(self._versions())
        return f"{self.label} ({versions}) of {hashlib.sha256(original).hexdigest()}".encode()

    def _versions(self) -> list[str]:
        # OpenCV decodes, whoever resizes and encodes.
        libraries: set[JpegLibrary] = {"opencv"}
        libraries |= {self.resizer} if self.resize is not None else set()
        libraries |= {self.encoder.library} if self.compression is not None else set()
        versions = list(map(encoder_versions, sorted(libraries)))
        return versions if self.video is None else [*versions, codec_versions()]
