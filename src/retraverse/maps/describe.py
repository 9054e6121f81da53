"""Frames in, descriptions out: in order, on a few threads, with bounded memory.

The techniques' heavy work is done outside Python's interpreter lock, so threads are enough.
The output does not depend on their number.
"""

import hashlib
import itertools
import os
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from typing import Protocol, TypeVar

from retraverse.errors import ConfigError, InputError
from retraverse.images import Frame
from retraverse.maps.frame_table import FrameRecord
from retraverse.maps.thumbnails import ThumbnailSpec, encode_thumbnail
from retraverse.techniques import BatchTechnique, Description, Technique
from retraverse.types import Progress, no_progress

__all__ = [
    "DescribedFrame",
    "Describer",
    "Frames",
    "available_cores",
    "count_frames",
    "describe_frames",
    "describe_traverse",
    "in_order",
]

item_ = TypeVar("item_")
result_ = TypeVar("result_")

LEAST_FOR_BATCHES = 32
"""Fewer frames than this are described one by one: measuring a batch would cost what it saves."""
WAITING_PER_THREAD = 2
"""Pictures asked for ahead of the one awaited, per thread: enough to keep all of them busy."""


class Frames(Protocol):
    """Frames that can be counted and walked through: a `Traverse`, a list, a tuple."""

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Frame]: ...


@dataclass(frozen=True)
class DescribedFrame:
    """All that a map keeps of one frame."""

    record: FrameRecord
    description: Description
    content: bytes
    """SHA-256 (32 bytes) of the frame's fingerprint: its file, or its pixels."""
    thumbnail: bytes | None
    """A small JPEG file, if asked for."""
    describe_s: float
    """Seconds that describing it took (t_e), with the other threads running beside it; in a
    batch, its share."""


class Describer(Protocol):
    """Describes the frames of a map, on threads of this process or elsewhere."""

    def __call__(
        self,
        frames: Frames,
        technique: Technique,
        *,
        thumbnails: ThumbnailSpec | None = None,
        progress: Progress = no_progress,
    ) -> Generator[DescribedFrame, None, None]:
        """Yield every frame described, in order; see `describe_frames`."""
        ...


def describe_traverse(
    traverse: Frames,
    technique: Technique,
    *,
    threads: int | None = None,
    progress: Progress = no_progress,
) -> Iterator[Description]:
    """Yield the description of every frame, in order.

    Parameters
    ----------
    traverse : Traverse or sequence of Frame
    technique : Technique
    threads : int >= 1, optional
        How many frames are described at once; default: the cores this process may use.
    progress : Progress
        Called with the frames as they are done.

    Raises
    ------
    InputError
        If there are no frames.
    FrameReadError
        If a picture cannot be read.
    """
    with closing(
        describe_frames(traverse, technique, threads=threads, progress=progress)
    ) as described:
        for frame in described:
            yield frame.description


def describe_frames(
    frames: Frames,
    technique: Technique,
    *,
    thumbnails: ThumbnailSpec | None = None,
    threads: int | None = None,
    progress: Progress = no_progress,
) -> Generator[DescribedFrame, None, None]:
    """Yield every frame described, with its record, content hash and thumbnail, in order.

    Parameters and errors as in `describe_traverse`; memory holds two frames per thread, or two
    batches where the technique is faster with several pictures at once.
    """
    n_frames = count_frames(frames)
    size = _batch_size(technique, n_frames)

    def describe(batch: list[Frame]) -> list[DescribedFrame]:
        return _describe(batch, technique, thumbnails)

    with closing(in_order(describe, _batches(frames, size), threads)) as described:
        each = itertools.chain.from_iterable(described)
        yield from progress(each, total=n_frames, label=f"describing with {technique.name}")


def count_frames(frames: Frames) -> int:
    """Return how many frames there are.

    Raises
    ------
    InputError
        If there are none, or if `frames` is only the address of some.
    """
    if isinstance(frames, (str, os.PathLike)):
        raise InputError(
            f"frames: got the path {os.fspath(frames)!r}, expected a traverse; "
            "open it first with open_traverse"
        )
    if not len(frames):
        name = getattr(frames, "name", "the traverse")
        raise InputError(f"{name}: no frames in it, expected at least one (wrong folder?)")
    return len(frames)


def _batch_size(technique: Technique, n_frames: int) -> int:
    """Return how many frames are described at once: 1, unless the technique is faster so."""
    if not isinstance(technique, BatchTechnique) or n_frames < LEAST_FOR_BATCHES:
        return 1
    return technique.batch_size()


def _batches(frames: Iterable[Frame], size: int) -> Iterator[list[Frame]]:
    source = iter(frames)
    while batch := list(itertools.islice(source, size)):
        yield batch


def _describe(
    frames: list[Frame], technique: Technique, thumbnails: ThumbnailSpec | None
) -> list[DescribedFrame]:
    images = [technique.read(frame) for frame in frames]
    began = time.perf_counter()
    if len(images) > 1 and isinstance(technique, BatchTechnique):
        descriptions = technique.describe_batch(images)
    else:
        descriptions = [technique.describe(image) for image in images]
    describe_s = (time.perf_counter() - began) / len(frames)
    return [
        DescribedFrame(
            # Not the frame itself: one of a video may hold its pixels.
            record=FrameRecord(frame.name, frame.index, frame.timestamp_s),
            description=description,
            content=hashlib.sha256(frame.fingerprint()).digest(),
            thumbnail=encode_thumbnail(frame.colour(), thumbnails) if thumbnails else None,
            describe_s=describe_s,
        )
        for frame, description in zip(frames, descriptions, strict=True)
    ]


def in_order(
    function: Callable[[item_], result_], items: Iterable[item_], threads: int | None = None
) -> Generator[result_, None, None]:
    """Yield ``function(item)`` for every item, in the items' order, on several threads.

    Items are taken only a little ahead of what has been yielded. The first error, in the
    items' order, is raised where its result would have come; nothing runs on afterwards.
    """
    n_threads = available_cores() if threads is None else threads
    if n_threads < 1:
        raise ConfigError(f"threads: got {n_threads}, expected 1 or more")
    waiting: deque[Future[result_]] = deque()
    source = iter(items)
    pool = ThreadPoolExecutor(n_threads, thread_name_prefix="retraverse")
    try:
        for item in itertools.islice(source, n_threads * WAITING_PER_THREAD):
            waiting.append(pool.submit(function, item))
        while waiting:
            result = waiting.popleft().result()
            for item in itertools.islice(source, 1):
                waiting.append(pool.submit(function, item))
            yield result
    finally:
        pool.shutdown(cancel_futures=True)


def available_cores() -> int:
    """Return how many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
