"""A few pictures in a row as one group of pictures of a video codec: H.265 or AV1.

What a robot would send instead of K JPEG files. A group is encoded on its own, from its first
picture to its last, and holds everything its decoder needs.

Form of a group, big endian: ``"GOP1"``, codec (1 byte), 1 if grey (1 byte), height, width, number
of pictures (2 bytes each), then each packet of the encoder after its length (3 bytes).

Conventions
- ``quality`` is the codec's constant rate factor: **larger is coarser**, at most
  `GroupCodec.worst`.
- Colour is stored like JPEG's: full-range YCbCr, both colour planes at half the size. So a
  comparison with JPEG at 4:2:0 compares the codecs and nothing else.
- One thread and no clock in the encoder: the same pictures give the same bytes by the same build.

Needs the extra ``video``.
"""

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast, get_args

import numpy as np

from retraverse.errors import ConfigError, InputError, MissingExtraError, ShapeError
from retraverse.images.decode import check_array
from retraverse.types import ImageArray

__all__ = ["GROUP_CODECS", "CodecName", "GroupCodec", "decode_group", "encode_group"]

CodecName = Literal["h265", "av1"]

_MAGIC = b"GOP1"
_HEAD_BYTES = 12
_LENGTH_BYTES = 3
_LONGEST_GROUP = 1000
_SMALLEST_SIDE = 64
"""SVT-AV1's; smaller pictures are padded, and cut again when decoded."""


@dataclass(frozen=True)
class GroupCodec:
    """A codec and the settings it is run with, which belong into every record."""

    name: CodecName
    encoder: str
    """FFmpeg's name."""
    decoders: tuple[str, ...]
    """FFmpeg's names, the first that is there is taken."""
    worst: int
    """The largest quality factor."""
    options: Mapping[str, str]
    """What is passed to the encoder beside the quality factor."""

    @property
    def label(self) -> str:
        """Encoder and settings in words, for records."""
        return " ".join([self.encoder, *(f"{key}={text}" for key, text in self.options.items())])


GROUP_CODECS: Mapping[str, GroupCodec] = MappingProxyType(
    {
        "h265": GroupCodec(
            "h265",
            "libx265",
            ("hevc",),
            51,
            {
                "preset": "medium",
                # info=0: else every group begins with two kilobytes of text about the encoder.
                "x265-params": "info=0:log-level=none:pools=none:frame-threads=1:wpp=0"
                ":lookahead-threads=0:scenecut=0:keyint=-1:repeat-headers=1",
            },
        ),
        "av1": GroupCodec(
            "av1",
            "libsvtav1",
            ("libdav1d", "av1"),
            63,
            {"preset": "5", "svtav1-params": "lp=1:scd=0"},
        ),
    }
)
"""Codec name -> its settings."""


def encode_group(
    images: Sequence[ImageArray], codec: CodecName = "av1", quality: int = 35
) -> bytes:
    """Return pictures as one group of a video codec.

    Parameters
    ----------
    images : sequence of uint8 array, shape (height, width) or (height, width, 3) RGB
        In order; all of one shape.
    codec : {"h265", "av1"}
    quality : int
        Constant rate factor, 0 to 51 (H.265) or 1 to 63 (AV1); larger is coarser.

    Raises
    ------
    ConfigError
        If the codec is unknown or the quality outside its range.
    ShapeError
        If pictures differ in shape.
    InputError
        If there are none, more than 1,000, or the encoder refuses them.
    MissingExtraError
        Without the extra ``video``.
    """
    av = _import_av()
    settings = _settings(codec)
    _check_quality(settings, quality)
    pictures = _checked(images)
    height, width = pictures[0].shape[:2]
    grey = pictures[0].ndim == 2
    try:
        packets = _encode(av, settings, quality, [_to_planes(one) for one in pictures])
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            f"{settings.encoder} refuses {width} x {height} pixels: {error}"
        ) from error
    head = _MAGIC + bytes([get_args(CodecName).index(codec), grey])
    head += b"".join(number.to_bytes(2, "big") for number in (height, width, len(pictures)))
    return head + b"".join(len(one).to_bytes(_LENGTH_BYTES, "big") + one for one in packets)


def decode_group(group: bytes) -> list[ImageArray]:
    """Return the pictures of a group, of the size and kind (grey or RGB) they had.

    Raises
    ------
    InputError
        If the bytes are no group, truncated or damaged.
    MissingExtraError
        Without the extra ``video``.
    """
    av = _import_av()
    settings, grey, (height, width, n_pictures) = _read_head(group)
    packets = _read_packets(group)
    try:
        planes = list(_decode(av, settings, packets, _coded_size(height, width)))
    except (av.FFmpegError, ValueError) as error:
        raise InputError(f"group of pictures: damaged {settings.name} data: {error}") from error
    coded = _coded_size(height, width)
    if len(planes) != n_pictures or any(one[0].shape != coded for one in planes):
        raise InputError(
            f"group of pictures: got {len(planes)} pictures, expected {n_pictures} of "
            f"{width} x {height} (damaged?)"
        )
    return [_from_planes(one, height, width, grey) for one in planes]


Planes = tuple[ImageArray, ImageArray, ImageArray]


def _import_av() -> Any:
    try:
        import av
    except ImportError as error:
        raise MissingExtraError(
            "video codecs need PyAV: pip install 'retraverse[video]'"
        ) from error
    return av


def _settings(codec: str) -> GroupCodec:
    if codec not in GROUP_CODECS:
        raise ConfigError(f"codec: got {codec!r}, expected one of {', '.join(GROUP_CODECS)}")
    return GROUP_CODECS[codec]


def _check_quality(settings: GroupCodec, quality: int) -> None:
    # SVT-AV1 takes 0 for "not given".
    best = 1 if settings.name == "av1" else 0
    if (
        isinstance(quality, bool)
        or quality != int(quality)
        or not best <= quality <= settings.worst
    ):
        raise ConfigError(
            f"quality of {settings.name}: got {quality}, expected {best} to {settings.worst} "
            "(larger is coarser)"
        )


def _checked(images: Sequence[ImageArray]) -> list[ImageArray]:
    pictures = [check_array(image) for image in images]
    if not 1 <= len(pictures) <= _LONGEST_GROUP:
        raise InputError(f"group of pictures: got {len(pictures)}, expected 1 to {_LONGEST_GROUP}")
    shapes = {picture.shape for picture in pictures}
    if len(shapes) > 1:
        raise ShapeError(f"group of pictures: got shapes {sorted(shapes)}, expected one")
    if max(pictures[0].shape[:2]) > 0xFFFF:
        raise ShapeError(f"group of pictures: {pictures[0].shape} is too large")
    return pictures


def _coded_size(height: int, width: int) -> tuple[int, int]:
    """Return the size that is encoded: even, and not below what SVT-AV1 takes."""
    padded = [max(_SMALLEST_SIDE, side + side % 2) for side in (height, width)]
    return padded[0], padded[1]


def _to_planes(picture: ImageArray) -> Planes:
    """Return full-range Y, Cb, Cr; the latter at half the size, by the mean of four."""
    import cv2

    coded_height, coded_width = _coded_size(*picture.shape[:2])
    below, right = coded_height - picture.shape[0], coded_width - picture.shape[1]
    padded = cv2.copyMakeBorder(picture, 0, below, 0, right, cv2.BORDER_REPLICATE)
    half = (coded_width // 2, coded_height // 2)
    if picture.ndim == 2:
        neutral = np.full(half[::-1], 128, np.uint8)
        return cast(Planes, (padded, neutral, neutral))
    luma, red, blue = cv2.split(cv2.cvtColor(padded, cv2.COLOR_RGB2YCrCb))
    small = [cv2.resize(plane, half, interpolation=cv2.INTER_AREA) for plane in (blue, red)]
    return cast(Planes, (luma, *small))


def _from_planes(planes: Planes, height: int, width: int, grey: bool) -> ImageArray:
    import cv2

    luma, blue, red = planes
    if grey:
        return np.ascontiguousarray(luma[:height, :width])
    size = luma.shape[::-1]
    full = [cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR) for plane in (red, blue)]
    rgb = cv2.cvtColor(cv2.merge([luma, *full]), cv2.COLOR_YCrCb2RGB)
    return np.ascontiguousarray(rgb[:height, :width], np.uint8)


def _encode(av: Any, settings: GroupCodec, quality: int, planes: list[Planes]) -> list[bytes]:
    context = av.CodecContext.create(settings.encoder, "w")
    context.height, context.width = planes[0][0].shape
    context.pix_fmt = "yuv420p"
    context.time_base = Fraction(1, 25)
    context.framerate = Fraction(25, 1)
    context.thread_count = 1
    context.gop_size = _LONGEST_GROUP
    context.options = {**settings.options, "crf": str(quality)}
    packets = []
    with _quiet_encoder():
        for number, picture in enumerate(planes):
            frame = _to_frame(av, picture)
            frame.pts = number
            packets += [bytes(packet) for packet in context.encode(frame)]
            if number == 0:
                _leave_real_time()
        packets += [bytes(packet) for packet in context.encode(None)]
    return [packet for packet in packets if packet]


def _leave_real_time() -> None:
    """Give threads the usual priority again: SVT-AV1 takes real-time where it runs as root.

    A robot's other programs would stand still while a window is encoded.
    """
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return
    for task in tasks.iterdir():
        with suppress(OSError):
            if os.sched_getscheduler(int(task.name)) in (os.SCHED_FIFO, os.SCHED_RR):
                os.sched_setscheduler(int(task.name), os.SCHED_OTHER, os.sched_param(0))


def _decode(
    av: Any, settings: GroupCodec, packets: list[bytes], coded: tuple[int, int]
) -> Iterator[Planes]:
    context = _decoder(av, settings)
    context.thread_count = 1
    # Damaged data may claim any size: no memory for more than the blocks around the picture.
    context.options = {"max_pixels": str((coded[0] + 128) * (coded[1] + 128))}
    for packet in packets:
        for frame in context.decode(av.Packet(packet)):
            yield _to_arrays(frame)
    for frame in context.decode(None):
        yield _to_arrays(frame)


def _decoder(av: Any, settings: GroupCodec) -> Any:
    for name in settings.decoders:
        try:
            return av.CodecContext.create(name, "r")
        except av.codec.codec.UnknownCodecError:
            continue
    raise InputError(f"this build of PyAV decodes no {settings.name}")


def _to_frame(av: Any, planes: Planes) -> Any:
    height, width = planes[0].shape
    frame = av.VideoFrame(width, height, "yuv420p")
    for plane, values in zip(frame.planes, planes, strict=True):
        padded = np.zeros((plane.height, plane.line_size), np.uint8)
        padded[:, : plane.width] = values
        plane.update(padded)
    return frame


def _to_arrays(frame: Any) -> Planes:
    if frame.format.name not in ("yuv420p", "yuvj420p"):
        raise ValueError(f"pictures of format {frame.format.name}")
    arrays = [
        np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[: plane.height, : plane.width]
        for plane in frame.planes
    ]
    return cast(Planes, tuple(array.copy() for array in arrays))


def _read_head(group: bytes) -> tuple[GroupCodec, bool, tuple[int, int, int]]:
    names = get_args(CodecName)
    if len(group) < _HEAD_BYTES or not group.startswith(_MAGIC) or group[4] >= len(names):
        raise InputError("group of pictures: these bytes are no group of this program's")
    height, width, n_pictures = (int.from_bytes(group[i : i + 2], "big") for i in (6, 8, 10))
    return GROUP_CODECS[names[group[4]]], bool(group[5]), (height, width, n_pictures)


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


_environment = threading.Lock()


@contextmanager
def _quiet_encoder() -> Iterator[None]:
    """Keep SVT-AV1's greeting off stderr; it listens to nothing but the environment."""
    with _environment:
        before = os.environ.get("SVT_LOG")
        os.environ["SVT_LOG"] = "0"
        try:
            yield
        finally:
            if before is None:
                del os.environ["SVT_LOG"]
            else:
                os.environ["SVT_LOG"] = before
