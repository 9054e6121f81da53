"""Pictures made worse on purpose: resized, then compressed, exactly as in the thesis.

Conventions
- Order: decode, resize, compress. What is compressed are the pixels OpenCV decodes; each c
  starts from them, never from another c's result.
- ``compression=None`` leaves the picture's own bytes alone (c = 0 of chapter 5); ``0`` is JPEG of
  quality 100 (c = 0 of chapter 6, where pictures were resized first).
- A grey file or array stays grey: its JPEG has one plane.
- Nothing is kept unless a `PictureCache` is given: a frame of `worsened` is made again each time
  its pixels are asked for, the one of `worsen_frame` holds its bytes.
- A frame's fingerprint names the original's and what was done, so that it is known without
  encoding; the two ways to the same picture have the same one.
"""

import hashlib
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from retraverse.errors import ConfigError, InputError
from retraverse.images.decode import (
    GreyPath,
    check_array,
    decode_bgr,
    decode_grey,
    decode_native,
    to_grey,
    to_rgb,
)
from retraverse.images.frame import Frame
from retraverse.images.jpeg import (
    Encoder,
    JpegLibrary,
    check_compression,
    encode_jpeg,
    encoder_versions,
)
from retraverse.images.pixels import ArrayPixels, Pixels
from retraverse.images.traverse import Traverse
from retraverse.types import ImageArray, IntArray, Progress, no_progress

__all__ = [
    "PictureCache",
    "Resizer",
    "WorsenedFrame",
    "Worsening",
    "frame_bytes",
    "native_pixels",
    "resize_square",
    "worsen_each",
    "worsen_frame",
    "worsened",
]

Resizer = Literal["pillow", "opencv"]
"""``pillow``: `Image.resize` with its default filter, bicubic with antialiasing (chapter 7);
``opencv``: `cv2.resize` with its default, bilinear without antialiasing (chapter 6)."""
_FILTERS: dict[str, str] = {"pillow": "bicubic", "opencv": "bilinear"}
LARGEST_SIDE = 16384


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

    @property
    def is_nothing(self) -> bool:
        """Whether pictures stay as they are."""
        return self.resize is None and self.compression is None

    @property
    def label(self) -> str:
        """What is done, in words, for records: two equal labels mean the same pictures."""
        words = []
        if self.resize is not None:
            words.append(f"resized to {self.resize} px by {self.resizer_label}")
        if self.compression is not None:
            words.append(f"JPEG c = {self.compression} by {self.encoder.label}")
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
        # OpenCV decodes, whoever resizes and encodes.
        libraries: set[JpegLibrary] = {"opencv"}
        libraries |= {self.resizer} if self.resize is not None else set()
        libraries |= {self.encoder.library} if self.compression is not None else set()
        versions = ", ".join(map(encoder_versions, sorted(libraries)))
        return f"{self.label} ({versions}) of {hashlib.sha256(original).hexdigest()}".encode()


@dataclass(frozen=True)
class WorsenedFrame:
    """One picture made worse, and what that took."""

    frame: Frame
    """Holds the new bytes; name, number and path are the original's."""
    n_bytes: int
    """Of the encoded picture. Where nothing was encoded: of the original file if it was not
    resized, else of the raw pixels."""
    compress_s: float
    """t_c: seconds to encode, decoding and resizing not counted; 0 where nothing was encoded."""


class PictureCache:
    """Decoded (and resized) pictures of the last frames asked for, up to so many bytes.

    Give one cache to all compressions of a drive and each picture is decoded once. A file that
    changes meanwhile is not noticed, so make a new cache for a new run. Thread-safe.

    Parameters
    ----------
    max_bytes : int
        Of pixels; the oldest go first. One picture is kept whatever its size.
    """

    def __init__(self, max_bytes: int = 64 * 2**20) -> None:
        self.max_bytes = max_bytes
        self.n_decoded = 0
        """How many pictures were not found here and had to be made."""
        self._lock = threading.Lock()
        # Keyed by identity; the pixel source is kept too, so that its id cannot be given away.
        self._kept: dict[tuple[int, int | None, str], tuple[Pixels, ImageArray]] = {}
        self._n_bytes = 0

    def pixels(self, source: Pixels, worsening: Worsening) -> ImageArray:
        """Return the resized pixels of a source, shared: not to be written to."""
        key = (id(source), worsening.resize, worsening.resizer if worsening.resize else "")
        with self._lock:
            kept = self._kept.pop(key, None)
            if kept is not None:
                self._kept[key] = kept  # now the youngest
                return kept[1]
        picture = _resized(source, worsening)
        with self._lock:
            self.n_decoded += 1
            if key not in self._kept:
                self._kept[key] = (source, picture)
                self._n_bytes += picture.nbytes
            while len(self._kept) > 1 and self._n_bytes > self.max_bytes:
                self._n_bytes -= self._kept.pop(next(iter(self._kept)))[1].nbytes
        return picture


def worsened(
    traverse: Traverse, worsening: Worsening, *, cache: PictureCache | None = None
) -> Traverse:
    """Return the drive with every picture made worse, lazily: nothing is read yet.

    Parameters
    ----------
    traverse : Traverse
    worsening : Worsening
        One that does nothing gives the traverse back.
    cache : PictureCache, optional
        Share one between several worsenings of one drive; without it each call of a frame's
        methods decodes and encodes anew.

    Returns
    -------
    Traverse
        Names and frame numbers stay, `source` says what was done. ``frame.encoded()`` is the
        JPEG file; None where pictures are only resized.
    """
    if worsening.is_nothing:
        return traverse
    frames = tuple(
        replace(frame, pixels=_LazyPixels(frame.pixels, worsening, cache)) for frame in traverse
    )
    return replace(traverse, source=f"{traverse.source}, {worsening.label}", frames=frames)


def worsen_frame(
    frame: Frame, worsening: Worsening, *, cache: PictureCache | None = None
) -> WorsenedFrame:
    """Return one picture made worse, its bytes in memory, with its size and t_c.

    Raises
    ------
    FrameReadError
        If the frame cannot be read.
    """
    return worsen_each(frame, (worsening,), cache=cache)[0]


def worsen_each(
    frame: Frame, worsenings: Sequence[Worsening], *, cache: PictureCache | None = None
) -> list[WorsenedFrame]:
    """Return one picture made worse in several ways; it is decoded once for each size.

    Parameters
    ----------
    frame : Frame
    worsenings : sequence of Worsening
        The results come in this order.
    cache : PictureCache, optional
        By default one for this call.

    Raises
    ------
    FrameReadError
        If the frame cannot be read.
    """
    cache = cache or PictureCache()
    with frame._naming():
        return [_worsen(frame, worsening, cache) for worsening in worsenings]


def frame_bytes(traverse: Iterable[Frame], *, progress: Progress = no_progress) -> IntArray:
    """Return the size in bytes of every encoded picture of a drive, int64 (N,).

    Raises
    ------
    InputError
        If a frame is no file (an array, a frame of a video, a picture that was only resized).
    FrameReadError
        If a frame cannot be read.
    """
    frames = list(traverse)
    sizes = [
        _size(frame) for frame in progress(frames, total=len(frames), label="measuring pictures")
    ]
    return np.asarray(sizes, np.int64)


def native_pixels(source: Pixels) -> ImageArray:
    """Return the pixels as the source has them: (height, width) if grey, else RGB.

    Raises
    ------
    FrameReadError
        If they cannot be read; the reason without the name.
    """
    encoded = source.encoded()
    if encoded is not None:
        native = decode_native(encoded)
        return native if native.ndim == 2 else to_rgb(native, "bgr")
    if isinstance(source, ArrayPixels):
        picture = check_array(source.items[source.position])
        return picture if picture.ndim == 2 else to_rgb(picture, source.colour_order)
    return source.rgb()


def resize_square(picture: ImageArray, side: int, resizer: Resizer) -> ImageArray:
    """Return a grey or RGB picture as a square, by the library's default filter."""
    if resizer == "opencv":
        import cv2

        return np.asarray(cv2.resize(picture, (side, side)), np.uint8)
    from PIL import Image

    return np.asarray(Image.fromarray(picture).resize((side, side)))


@dataclass(frozen=True, slots=True)
class _LazyPixels:
    """A worse picture that is made when asked for."""

    original: Pixels
    worsening: Worsening
    cache: PictureCache | None

    def encoded(self) -> bytes | None:
        """Return the JPEG file, None where there is only resizing."""
        if self.worsening.compression is None:
            return None
        return encode_jpeg(self._resized(), self.worsening.compression, self.worsening.encoder)

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width)."""
        return self._made().grey(path)

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        return self._made().rgb()

    def fingerprint(self) -> bytes:
        """Return what was done to which original; nothing is encoded for it."""
        return self.worsening.fingerprint(self.original.fingerprint())

    def _resized(self) -> ImageArray:
        if self.cache is None:
            return _resized(self.original, self.worsening)
        return self.cache.pixels(self.original, self.worsening)

    def _made(self) -> "_HeldPixels":
        encoded = self.encoded()
        return _HeldPixels(encoded, None if encoded is not None else self._resized(), b"")


@dataclass(frozen=True, slots=True)
class _HeldPixels:
    """A worse picture in memory: its file, or its pixels where it was only resized."""

    file: bytes | None
    picture: ImageArray | None
    identity: bytes

    def encoded(self) -> bytes | None:
        """Return the JPEG file, None where there is only resizing."""
        return self.file

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width)."""
        if self.file is not None:
            return decode_grey(self.file, path)
        assert self.picture is not None
        return to_grey(self.picture, "rgb")

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        if self.file is not None:
            return to_rgb(decode_bgr(self.file), "bgr")
        assert self.picture is not None
        return to_rgb(self.picture, "rgb")

    def fingerprint(self) -> bytes:
        """Return what was done to which original."""
        return self.identity


def _resized(source: Pixels, worsening: Worsening) -> ImageArray:
    picture = native_pixels(source)
    if worsening.resize is None:
        return picture
    return resize_square(picture, worsening.resize, worsening.resizer)


def _worsen(frame: Frame, worsening: Worsening, cache: PictureCache) -> WorsenedFrame:
    if worsening.is_nothing:
        own = frame.pixels.encoded()
        n_bytes = native_pixels(frame.pixels).nbytes if own is None else len(own)
        return WorsenedFrame(frame, n_bytes, 0.0)
    picture = cache.pixels(frame.pixels, worsening)
    identity = worsening.fingerprint(frame.pixels.fingerprint())
    if worsening.compression is None:
        held = _HeldPixels(None, picture, identity)
        return WorsenedFrame(replace(frame, pixels=held), picture.nbytes, 0.0)
    _warm(worsening.encoder.library)
    started = time.perf_counter()
    file = encode_jpeg(picture, worsening.compression, worsening.encoder)
    compress_s = time.perf_counter() - started
    held = _HeldPixels(file, None, identity)
    return WorsenedFrame(replace(frame, pixels=held), len(file), compress_s)


@lru_cache
def _warm(library: JpegLibrary) -> None:
    """Encode once without a clock: the first call of a process also imports."""
    encode_jpeg(np.zeros((8, 8), np.uint8), 50, Encoder(library=library))


def _size(frame: Frame) -> int:
    encoded = frame.encoded()
    if encoded is None:
        raise InputError(
            f"{frame.name}: no encoded picture to measure (an array, a frame of a video, or only "
            "resized); compress it first"
        )
    return len(encoded)
