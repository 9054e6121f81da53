"""A few pictures in a row as one group of pictures of a video codec: H.265 or AV1.

What a robot would send instead of K JPEG files. A group is encoded on its own, from its first
picture to its last, and holds everything its decoder needs; `group_bytes` has its byte form.

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
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from retraverse.errors import ConfigError, InputError, MissingExtraError, ShapeError
from retraverse.images.colour_planes import Planes, coded_size, from_planes, to_planes
from retraverse.images.decode import check_array
from retraverse.images.group_bytes import (
    LONGEST_SIDE,
    CodecName,
    GroupHead,
    join_group,
    split_group,
)
from retraverse.types import ImageArray

__all__ = [
    "GROUP_CODECS",
    "LONGEST_GROUP",
    "CodecName",
    "GroupCodec",
    "check_quality",
    "codec_versions",
    "decode_group",
    "encode_group",
]

LONGEST_GROUP = 1000
"""Pictures."""
_ONE_BLOCK = 64
"""Side of x265's largest blocks."""


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
    if_one_block: Mapping[str, str] = field(default_factory=dict)
    """What is passed instead where a picture is no wider or no higher than 64 pixels."""

    @property
    def label(self) -> str:
        """Encoder and settings in words, for records."""
        words = [self.encoder, *(f"{key}={text}" for key, text in self.options.items())]
        words += [f"(one block across: {key}={text})" for key, text in self.if_one_block.items()]
        return " ".join(words)

    def options_for(self, height: int, width: int) -> dict[str, str]:
        """Return what is passed to the encoder for pictures of one size."""
        is_one_block = min(height, width) <= _ONE_BLOCK
        return {**self.options, **(self.if_one_block if is_one_block else {})}


# info=0: else every group begins with two kilobytes of text about the encoder.
_X265 = (
    "info=0:log-level=none:pools=none:frame-threads=1:wpp=0"
    ":lookahead-threads=0:scenecut=0:keyint=-1:repeat-headers=1"
)
GROUP_CODECS: Mapping[str, GroupCodec] = MappingProxyType(
    {
        "h265": GroupCodec(
            "h265",
            "libx265",
            ("hevc",),
            51,
            {
                "preset": "medium",
                "x265-params": _X265,
            },
            # With a single block across x265 gives other bytes each time.
            {"x265-params": f"{_X265}:ctu=32"},
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
    check_quality(settings, quality)
    pictures = _checked(images)
    height, width = pictures[0].shape[:2]
    grey = pictures[0].ndim == 2
    try:
        packets = _encode(av, settings, quality, [to_planes(one) for one in pictures])
    except (av.FFmpegError, OSError, ValueError) as error:
        raise InputError(
            f"{settings.encoder} refuses {width} x {height} pixels: {error}"
        ) from error
    return join_group(GroupHead(codec, grey, height, width, len(pictures)), packets)


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
    head, packets = split_group(group)
    settings, coded = GROUP_CODECS[head.codec], coded_size(head.height, head.width)
    try:
        planes = list(_decode(av, settings, packets, coded))
    except (av.FFmpegError, ValueError) as error:
        raise InputError(f"group of pictures: damaged {settings.name} data: {error}") from error
    if len(planes) != head.n_pictures or any(one[0].shape != coded for one in planes):
        raise InputError(
            f"group of pictures: got {len(planes)} pictures, expected {head.n_pictures} of "
            f"{head.width} x {head.height} (damaged?)"
        )
    return [from_planes(one, head.height, head.width, grey=head.grey) for one in planes]


def codec_versions() -> str:
    """Return the version of what encodes and decodes, for provenance and content hashes.

    Raises
    ------
    MissingExtraError
        Without the extra ``video``.
    """
    return f"pyav {_import_av().__version__}"


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


def check_quality(settings: GroupCodec, quality: int) -> None:
    """Raise ConfigError if a codec has no such quality factor."""
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
    if not 1 <= len(pictures) <= LONGEST_GROUP:
        raise InputError(f"group of pictures: got {len(pictures)}, expected 1 to {LONGEST_GROUP}")
    shapes = {picture.shape for picture in pictures}
    if len(shapes) > 1:
        raise ShapeError(f"group of pictures: got shapes {sorted(shapes)}, expected one")
    if max(pictures[0].shape[:2]) > LONGEST_SIDE:
        raise ShapeError(f"group of pictures: {pictures[0].shape} is too large")
    return pictures


def _encode(av: Any, settings: GroupCodec, quality: int, planes: list[Planes]) -> list[bytes]:
    context = av.CodecContext.create(settings.encoder, "w")
    context.height, context.width = planes[0][0].shape
    context.pix_fmt = "yuv420p"
    context.time_base = Fraction(1, 25)
    context.framerate = Fraction(25, 1)
    context.thread_count = 1
    context.gop_size = LONGEST_GROUP
    context.options = {**settings.options_for(context.height, context.width), "crf": str(quality)}
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
