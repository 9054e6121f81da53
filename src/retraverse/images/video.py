"""Frames of a video file, through OpenCV.

Conventions
- Frames are counted by reading the whole video once: what a file announces about itself is
  often an estimate, and wrong when it is truncated.
- The picture is what OpenCV gives: 8-bit colour, turned upright where the file says so. A
  video has no decoder's grey of its own here, so both grey paths convert colour.
"""

import hashlib
import os
import threading
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, cast

from retraverse.errors import FrameReadError
from retraverse.images.decode import GreyPath, quiet_opencv, to_grey, to_rgb
from retraverse.images.frame import Frame
from retraverse.images.traverse import Traverse
from retraverse.types import ImageArray, Progress, no_progress

if TYPE_CHECKING:
    import cv2

__all__ = ["VideoReader", "open_video"]

# Threads that share a reader ask for frames a little out of order: this much is kept of what
# was passed on the way, so that they do not send it back to the start of the file.
_KEPT_BYTES = 128 * 2**20
_KEPT_FRAMES = 64


def open_video(path: Path, *, every: int = 1, progress: Progress = no_progress) -> Traverse:
    """Return the traverse of all frames of a video, after counting them.

    Parameters
    ----------
    path : Path
    every : int
        Which frames will be asked for, every `every`-th; only speeds up their reading.
    progress : Progress
        Shows how far the counting has come.

    Warns
    -----
    UserWarning
        If fewer frames can be read than the file announces: it is probably truncated. The
        traverse holds those it has, and its `source` says so too.

    Raises
    ------
    FrameReadError
        If OpenCV finds no pictures in the file.
    """
    try:
        scan = _scan(path, progress)
    except FrameReadError as error:
        raise FrameReadError(f"cannot read {path}: {error}") from error
    n_frames = len(scan.times_ms)
    source = f"video {path} ({n_frames} frames)"
    # An announced number may be an estimate from the duration, which is one too high at times.
    if n_frames < scan.n_announced - 1:
        source = f"video {path} ({n_frames} of {scan.n_announced} announced frames: truncated?)"
        warnings.warn(f"opened {source}", stacklevel=2)
    reader = VideoReader(path, every=every)
    frames = tuple(
        Frame(
            f"{path.name}#{index:06d}",
            index,
            timestamp_s=time_s,
            pixels=_VideoPixels(reader, index),
        )
        for index, time_s in enumerate(scan.times_s())
    )
    return Traverse(path.name, source, frames)


class VideoReader:
    """The frames of one video by number: fast forwards, correct in any order. Thread-safe.

    Going back further than what is kept in memory reads the video again from its start,
    since seeking in a compressed video is not exact.

    Parameters
    ----------
    path : Path
    every : int
        Which frames will be asked for; those between are decoded but not converted.
    """

    def __init__(self, path: Path, *, every: int = 1) -> None:
        self.path = path
        self._every = every
        self._lock = threading.Lock()
        self._capture: cv2.VideoCapture | None = None
        self._position = 0  # the frame the next grab gives
        self._kept: dict[int, ImageArray] = {}  # oldest first
        self._file_hash: bytes | None = None

    def read(self, index: int) -> ImageArray:
        """Return frame `index`, uint8 (height, width, 3) BGR, shared: not to be written to.

        Raises
        ------
        FrameReadError
            If the video ends before it or OpenCV cannot decode it.
        """
        with self._lock:
            if index not in self._kept:
                self._advance_to(index)
            return self._kept[index]

    def file_hash(self) -> bytes:
        """Return the SHA-256 of the file, computed once."""
        with self._lock:
            if self._file_hash is None:
                self._file_hash = _hash_file(self.path)
            return self._file_hash

    def _advance_to(self, index: int) -> None:
        if self._capture is None or index < self._position:
            self._capture, self._position = _capture(self.path), 0
        while self._position <= index:
            if not self._capture.grab():
                raise FrameReadError(f"the video now ends after {self._position} frames")
            near = index - self._position < _KEPT_FRAMES * self._every
            if self._position == index or (near and self._position % self._every == 0):
                self._keep(self._position, _retrieve(self._capture))
            self._position += 1

    def _keep(self, index: int, picture: ImageArray) -> None:
        self._kept[index] = picture
        while len(self._kept) > 1 and (
            len(self._kept) > _KEPT_FRAMES or len(self._kept) * picture.nbytes > _KEPT_BYTES
        ):
            del self._kept[next(iter(self._kept))]


@dataclass(frozen=True, slots=True)
class _VideoPixels:
    """One frame of a video."""

    reader: VideoReader
    index: int

    def encoded(self) -> None:
        """Return None: a frame of a video is no file."""
        return None

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width); `path` makes no difference."""
        return to_grey(self.reader.read(self.index), "bgr")

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        return to_rgb(self.reader.read(self.index), "bgr")

    def fingerprint(self) -> bytes:
        """Return the file's hash and the frame number: decoders differ in the pixels."""
        return self.reader.file_hash() + str(self.index).encode()


@dataclass(frozen=True)
class _Scan:
    """What one walk through a video finds."""

    times_ms: list[float]
    n_announced: int
    frames_per_second: float

    def times_s(self) -> list[float | None]:
        """Return the time of each frame; from the frame rate where the file has no times."""
        times = self.times_ms
        if all(earlier < later for earlier, later in pairwise(times)):
            return [round(time / 1000, 6) for time in times]
        if self.frames_per_second > 0:
            return [round(i / self.frames_per_second, 6) for i in range(len(times))]
        return [None] * len(times)


def _scan(path: Path, progress: Progress) -> _Scan:
    import cv2

    capture = _capture(path)
    n_announced = max(int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
    label = f"counting frames of {path.name}"
    with quiet_opencv():
        times = list(progress(_grabbed_times(capture), total=n_announced, label=label))
    if not times:
        raise FrameReadError(_NO_PICTURES)
    return _Scan(times, n_announced, capture.get(cv2.CAP_PROP_FPS))


def _grabbed_times(capture: "cv2.VideoCapture") -> Iterator[float]:
    import cv2

    while capture.grab():
        yield capture.get(cv2.CAP_PROP_POS_MSEC)


_NO_PICTURES = (
    "OpenCV finds no video in it (a truncated .mp4 has lost its index; .avi and .mkv can "
    "be read as far as they go)"
)


def _capture(path: Path) -> "cv2.VideoCapture":
    import cv2

    # FFmpeg writes to stderr by itself and reads its level when OpenCV first loads it.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    with quiet_opencv():
        capture = cv2.VideoCapture(str(path))
    # Asked for a file with a number in its name, OpenCV tries numbered pictures as well.
    if not capture.isOpened() or capture.getBackendName() == "CV_IMAGES":
        raise FrameReadError(_NO_PICTURES)
    return capture


def _retrieve(capture: "cv2.VideoCapture") -> ImageArray:
    ok, picture = capture.retrieve()
    if not ok or picture is None:
        raise FrameReadError("OpenCV cannot decode it")
    return cast(ImageArray, picture)


def _hash_file(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError as error:
        raise FrameReadError(error.strerror or str(error)) from error
