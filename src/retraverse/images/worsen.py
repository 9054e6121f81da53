"""Pictures made worse on purpose: resized, then compressed, exactly as in the thesis.

`retraverse.images.worsening` says what is done; this does it.

Conventions
- A grey file or array stays grey: its JPEG has one plane.
- Nothing is kept unless a `PictureCache` is given: a frame of `worsened` is made again each time
  its pixels are asked for, the one of `worsen_frame` holds its bytes.
- A frame's fingerprint names the original's and what was done, so that it is known without
  encoding; the ways to the same picture have the same one.
- Groups of a video codec are counted from the first frame given; each picture is taken to weigh
  its share of the group, and its fingerprint names all pictures of the group.
"""

import hashlib
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from retraverse.errors import InputError
from retraverse.images.codecs import CodecName, decode_group, encode_group
from retraverse.images.decode import GreyPath, decode_bgr, decode_grey, to_grey, to_rgb
from retraverse.images.frame import Frame
from retraverse.images.jpeg import Encoder, JpegLibrary, encode_jpeg
from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.images.picture_cache import PictureCache, native_pixels, resized_pixels
from retraverse.images.pixels import Pixels
from retraverse.images.traverse import Traverse
from retraverse.images.worsening import Worsening
from retraverse.types import ImageArray, IntArray, Progress, no_progress

__all__ = [
    "WorsenedFrame",
    "frame_bytes",
    "worsen_each",
    "worsen_frame",
    "worsen_group",
    "worsened",
]

KEPT_GROUPS = 4
"""Decoded groups of a lazy drive that are held: threads ask for frames a little out of order."""


@dataclass(frozen=True)
class WorsenedFrame:
    """One picture made worse, and what that took."""

    frame: Frame
    """Holds the new bytes; name, number and path are the original's."""
    n_bytes: int
    """Of the encoded picture, or its share of its group. Where nothing was encoded: of the original
    file if it was not resized, else of the raw pixels."""
    compress_s: float
    """t_c: seconds to encode, decoding and resizing not counted; 0 where nothing was encoded."""


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
        JPEG file; None where there is none.
    """
    if worsening.is_nothing:
        return traverse
    listed = tuple(traverse)
    sent = None if worsening.video is None else _SentGroups(listed, worsening, cache)
    frames = tuple(
        replace(frame, pixels=_LazyPixels(frame.pixels, worsening, cache, sent, index))
        for index, frame in enumerate(listed)
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


def worsen_group(
    frames: Sequence[Frame], worsening: Worsening, *, cache: PictureCache | None = None
) -> list[WorsenedFrame]:
    """Return pictures sent together as one group of a video codec, however many they are.

    Parameters
    ----------
    frames : sequence of Frame
        At least one; all of one size once they are resized.
    worsening : Worsening
        Its `video` says how.
    cache : PictureCache, optional

    Raises
    ------
    FrameReadError
        If a frame cannot be read.
    InputError
        If the pictures differ in size, or the encoder refuses them.
    MissingExtraError
        Without the extra ``video``.
    """
    sent, seconds = _as_group(frames, worsening, cache or PictureCache())
    sizes = np.diff(np.linspace(0, len(sent), len(frames) + 1).round().astype(int)).tolist()
    held = [
        _HeldPixels(None, picture, _identity_in_group(frames, place, worsening))
        for place, picture in enumerate(decode_group(sent))
    ]
    return [
        WorsenedFrame(replace(frame, pixels=pixels), n_bytes, seconds / len(frames))
        for frame, pixels, n_bytes in zip(frames, held, sizes, strict=True)
    ]


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


@dataclass(frozen=True, slots=True)
class _LazyPixels:
    """A worse picture that is made when asked for."""

    original: Pixels
    worsening: Worsening
    cache: PictureCache | None
    sent: "_SentGroups | None"
    index: int
    """Among the frames that are sent."""

    def encoded(self) -> bytes | None:
        """Return the JPEG file, None where there is none."""
        if self.worsening.compression is None or not self.worsening.is_file:
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
        if self.sent is not None:
            return self.sent.fingerprint(self.index)
        return self.worsening.fingerprint(self.original.fingerprint())

    def _resized(self) -> ImageArray:
        if self.cache is None:
            return resized_pixels(self.original, self.worsening)
        return self.cache.pixels(self.original, self.worsening)

    def _made(self) -> "_HeldPixels":
        encoded = self.encoded()
        if encoded is not None:
            return _HeldPixels(encoded, None, b"")
        if self.sent is not None:
            return _HeldPixels(None, self.sent.picture(self.index), b"")
        return _HeldPixels(None, _damaged(self._resized(), self.worsening), b"")


class _SentGroups:
    """The pictures of a drive as they arrive in groups; those of the last few groups are kept."""

    def __init__(
        self, frames: Sequence[Frame], worsening: Worsening, cache: PictureCache | None
    ) -> None:
        assert worsening.video is not None
        self._frames, self._worsening = frames, worsening
        self._cache = cache or PictureCache()
        self._length = worsening.video.length
        self._lock = threading.Lock()
        self._kept: dict[int, list[ImageArray]] = {}

    def picture(self, index: int) -> ImageArray:
        """Return the picture of one frame; its whole group is sent for it, if it is not kept."""
        number, place = divmod(index, self._length)
        with self._lock:
            pictures = self._kept.pop(number, None)
            if pictures is None:
                sent, _ = _as_group(self._group(number), self._worsening, self._cache)
                pictures = decode_group(sent)
            self._kept[number] = pictures  # now the youngest
            while len(self._kept) > KEPT_GROUPS:
                del self._kept[next(iter(self._kept))]
        return pictures[place]

    def fingerprint(self, index: int) -> bytes:
        """Return what was done to which originals; nothing is encoded for it."""
        number, place = divmod(index, self._length)
        return _identity_in_group(self._group(number), place, self._worsening)

    def _group(self, number: int) -> Sequence[Frame]:
        return self._frames[number * self._length : (number + 1) * self._length]


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


def _worsen(frame: Frame, worsening: Worsening, cache: PictureCache) -> WorsenedFrame:
    if worsening.is_nothing:
        own = frame.pixels.encoded()
        n_bytes = native_pixels(frame.pixels).nbytes if own is None else len(own)
        return WorsenedFrame(frame, n_bytes, 0.0)
    if worsening.video is not None:
        return worsen_group((frame,), worsening, cache=cache)[0]
    picture = cache.pixels(frame.pixels, worsening)
    identity = worsening.fingerprint(frame.pixels.fingerprint())
    if worsening.compression is None or not worsening.is_file:
        held = _HeldPixels(None, _damaged(picture, worsening), identity)
        return WorsenedFrame(replace(frame, pixels=held), picture.nbytes, 0.0)
    _warm(worsening.encoder.library)
    started = time.perf_counter()
    file = encode_jpeg(picture, worsening.compression, worsening.encoder)
    compress_s = time.perf_counter() - started
    held = _HeldPixels(file, None, identity)
    return WorsenedFrame(replace(frame, pixels=held), len(file), compress_s)


def _damaged(picture: ImageArray, worsening: Worsening) -> ImageArray:
    """Return a picture with one part of JPEG's damage, if one is asked for."""
    if not worsening.part or worsening.compression is None:
        return picture
    return JPEG_PARTS[worsening.part].apply(picture, worsening.compression)


def _as_group(
    frames: Sequence[Frame], worsening: Worsening, cache: PictureCache
) -> tuple[bytes, float]:
    """Return pictures as a group, and the seconds that took."""
    video = worsening.video
    assert video is not None
    pictures = []
    for frame in frames:
        with frame._naming():
            pictures.append(cache.pixels(frame.pixels, worsening))
    _warm_codec(video.codec)
    started = time.perf_counter()
    sent = encode_group(pictures, video.codec, video.quality)
    return sent, time.perf_counter() - started


def _identity_in_group(frames: Sequence[Frame], place: int, worsening: Worsening) -> bytes:
    """Return what identifies one picture of a group: it depends on all the others."""
    digests = [hashlib.sha256(frame.pixels.fingerprint()).digest() for frame in frames]
    return worsening.fingerprint(b"".join([*digests, place.to_bytes(4, "big")]))


@lru_cache
def _warm(library: JpegLibrary) -> None:
    """Encode once without a clock: the first call of a process also imports."""
    encode_jpeg(np.zeros((8, 8), np.uint8), 50, Encoder(library=library))


@lru_cache
def _warm_codec(codec: CodecName) -> None:
    encode_group([np.zeros((64, 64), np.uint8)], codec)


def _size(frame: Frame) -> int:
    encoded = frame.encoded()
    if encoded is None:
        raise InputError(
            f"{frame.name}: no encoded picture to measure (an array, a frame of a video, or only "
            "resized); compress it first"
        )
    return len(encoded)
