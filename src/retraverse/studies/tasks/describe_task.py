"""One task of a study: some frames of a drive, made worse in every way asked for, and described.

All that several runs need of a frame is made once: it is read once, decoded once for each size,
compressed once for each c, decoded once for each grey path, and described once by each technique.
Frames that go into one group of a video codec are encoded together.
A technique that fails on a frame spoils its own results and nobody else's.
"""

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from retraverse.errors import InputError
from retraverse.images import Frame, GreyPath
from retraverse.images.bare_jpeg import TableSet, strip_tables
from retraverse.images.jpeg import Encoder
from retraverse.images.picture_cache import PictureCache
from retraverse.images.pixels import ArrayPixels, Pixels
from retraverse.images.worsen import WorsenedFrame, worsen_each, worsen_group
from retraverse.images.worsening import Worsening
from retraverse.studies.measuring.legibility import smallest_legible_height
from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.techniques import Description, Descriptions, Technique
from retraverse.techniques.handmade.picture_entropy import picture_entropy
from retraverse.types import Array, ImageArray

__all__ = [
    "DescribeTask",
    "Described",
    "Wanted",
    "describe_task",
    "made_technique",
    "one_line_reason",
]

BATCH_FRAMES = 8
"""Frames whose pixels are held at once, at every c; more where a group of pictures is longer."""
TIMES = "describe_s"
"""Name of the array of seconds (t_e of every frame) beside a technique's own arrays."""


@dataclass(frozen=True)
class Wanted:
    """One cache entry to make."""

    key: str
    """Its key."""
    worsening: Worsening
    """What is done to the pictures."""
    technique: TechniqueChoice | None
    """Who describes them; None = their sizes, t_c and entropy."""
    entropy: bool = False
    """Whether the pictures' entropy is measured (without a technique)."""
    legibility: bool = False
    """Whether nothing but what can still be read is measured, in scenes of our own."""


@dataclass(frozen=True)
class DescribeTask:
    """Frames of one drive and what is to be made of them."""

    label: str
    """For messages."""
    frames: tuple[Frame, ...]
    digests: tuple[bytes, ...]
    """SHA-256 of every frame's fingerprint, as the keys were made with."""
    wanted: tuple[Wanted, ...]


@dataclass(frozen=True)
class Described:
    """What a task made."""

    entries: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    """Key -> arrays of a cache entry, one row per frame."""
    errors: Mapping[str, str] = field(default_factory=dict)
    """Key -> why there is no entry, one line."""


def describe_task(task: DescribeTask) -> Described:
    """Return the entries of a task; what goes wrong is in `Described.errors`, not raised."""
    makers = {wanted.key: _maker(wanted) for wanted in task.wanted}
    try:
        size = _batch_frames(task.wanted)
        for start in range(0, len(task.frames), size):
            batch = slice(start, start + size)
            _add_batch(task.frames[batch], task.digests[batch], makers)
    except Exception as error:
        # Nobody can use a frame that cannot be read.
        reason = one_line_reason(error)
        return Described({}, dict.fromkeys(makers, reason))
    return Described(
        {key: maker.arrays() for key, maker in makers.items() if not maker.error},
        {key: maker.error for key, maker in makers.items() if maker.error},
    )


@lru_cache(maxsize=16)
def _made(name: str, parameters: tuple[tuple[str, Any], ...]) -> Technique:
    return TechniqueChoice(name, dict(parameters)).make()


def made_technique(choice: TechniqueChoice) -> Technique:
    """Return the technique of a choice; its network is loaded once in this process."""
    return _made(choice.name, tuple(sorted(choice.parameters.items())))


_warm: set[int] = set()
"""Techniques that have described something in this process."""


class _PictureMaker:
    """Sizes (with and without constant tables), t_c and entropy of pictures."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted
        self.error = ""
        self._rows: list[tuple[int, int, float, float]] = []

    def add(self, frames: Sequence["_Picture"]) -> None:
        for picture in frames:
            entropy = picture_entropy(picture.frame.grey()) if self.wanted.entropy else np.nan
            n_bare = _bare_bytes(picture.frame, self.wanted.worsening)
            self._rows.append((picture.n_bytes, n_bare, picture.compress_s, entropy))

    def arrays(self) -> dict[str, Array]:
        n_bytes, n_bare, compress_s, entropy = zip(*self._rows, strict=True)
        return {
            "n_bytes": np.array(n_bytes, np.int64),
            "n_bare_bytes": np.array(n_bare, np.int64),
            "compress_s": np.array(compress_s, np.float64),
            "entropy": np.array(entropy, np.float64),
        }


class _LegibilityMaker:
    """What can be read in scenes of our own that are made worse like a drive; needs no frames."""

    error = ""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted

    def add(self, frames: Sequence["_Picture"]) -> None:
        pass

    def arrays(self) -> dict[str, Array]:
        return {"height": np.array([smallest_legible_height(self.wanted.worsening)])}


class _DescriptionMaker:
    """Descriptions of pictures by one technique, and the seconds each took.

    One picture at a time, also where a technique takes several at once: how many are best is
    measured on the machine, and the last digits would depend on it. It is what t_e means, too.
    """

    def __init__(self, wanted: Wanted, technique: Technique | None, error: str) -> None:
        self.wanted = wanted
        self.error = error
        self._technique = technique
        self._described: list[Description] = []
        self._seconds: list[float] = []

    def add(self, frames: Sequence["_Picture"]) -> None:
        if self.error or self._technique is None:
            return
        done, names = len(self._described), [picture.frame.name for picture in frames]
        try:
            for picture in frames:
                self._describe_one(self._technique.read(picture.frame))
        except Exception as error:
            at = min(len(self._described) - done, len(names) - 1)
            self.error = f"{self._technique.name} on {names[at]}: {one_line_reason(error)}"

    def _describe_one(self, image: ImageArray) -> None:
        assert self._technique is not None
        if id(self._technique) not in _warm:
            self._technique.describe(image)  # The first call of a process also loads and imports.
            _warm.add(id(self._technique))
        began = time.perf_counter()
        self._described.append(self._technique.describe(image))
        self._seconds.append(time.perf_counter() - began)

    def arrays(self) -> dict[str, Array]:
        assert self._technique is not None
        stacked = Descriptions.stack(self._described, self._technique.layout)
        return {**stacked.arrays, TIMES: np.array(self._seconds, np.float64)}


_Maker = _PictureMaker | _LegibilityMaker | _DescriptionMaker


def _maker(wanted: Wanted) -> _Maker:
    if wanted.legibility:
        return _LegibilityMaker(wanted)
    if wanted.technique is None:
        return _PictureMaker(wanted)
    try:
        return _DescriptionMaker(wanted, made_technique(wanted.technique), "")
    except Exception as error:
        return _DescriptionMaker(wanted, None, one_line_reason(error))


@dataclass(frozen=True)
class _Picture:
    """One frame made worse in one way."""

    frame: Frame
    n_bytes: int
    compress_s: float

    @classmethod
    def of(cls, worse: WorsenedFrame) -> "_Picture":
        """Return it as pixels of which nothing is decoded twice."""
        frame = replace(worse.frame, pixels=_Remembered(worse.frame.pixels))
        return cls(frame, worse.n_bytes, worse.compress_s)


def _batch_frames(wanted: Sequence[Wanted]) -> int:
    """Return how many frames are held at once: whole groups of pictures."""
    lengths = [one.worsening.video.length for one in wanted if one.worsening.video is not None]
    return max([BATCH_FRAMES, *lengths])


def _add_batch(
    frames: Sequence[Frame], digests: Sequence[bytes], makers: Mapping[str, _Maker]
) -> None:
    ways = list(dict.fromkeys(maker.wanted.worsening for maker in makers.values()))
    known = [_known(*pair) for pair in zip(frames, digests, strict=True)]
    for way, pictures in _worsen_all(known, ways).items():
        for maker in makers.values():
            if maker.wanted.worsening == way:
                maker.add(pictures)


def _known(frame: Frame, digest: bytes) -> Frame:
    """Return a frame, read, if it still is the one the keys were made with."""
    read = _read_once(frame.pixels)
    if hashlib.sha256(replace(frame, pixels=read).fingerprint()).digest() != digest:
        raise InputError(f"{frame.name} changed while the study ran; run it again")
    # From here on its digest stands for it: hashed once, not once for each c.
    return replace(frame, pixels=_identified(read, digest))


def _worsen_all(
    frames: Sequence[Frame], ways: Sequence[Worsening]
) -> dict[Worsening, list[_Picture]]:
    """Return frames made worse in all ways, decoded once for each size."""
    cache = PictureCache()
    alone = [way for way in ways if way.video is None]
    rows = [worsen_each(frame, alone, cache=cache) for frame in frames]
    made = {way: [row[column] for row in rows] for column, way in enumerate(alone)}
    for way in ways:
        if way.video is not None:
            starts = range(0, len(frames), way.video.length)
            groups = [frames[start : start + way.video.length] for start in starts]
            made[way] = [one for group in groups for one in worsen_group(group, way, cache=cache)]
    return {way: list(map(_Picture.of, worse)) for way, worse in made.items()}


@lru_cache(maxsize=64)
def _tables(encoder: Encoder, compression: int) -> TableSet:
    return TableSet.for_encoder(encoder, [compression])


def _bare_bytes(frame: Frame, worsening: Worsening) -> int:
    """Return the size of a picture without its constant tables, -1 where it is no JPEG of ours."""
    encoded = frame.encoded() if worsening.is_file else None
    if encoded is None or worsening.compression is None:
        return -1
    return len(strip_tables(encoded, _tables(worsening.encoder, worsening.compression)))


def _read_once(pixels: Pixels) -> Pixels:
    """Return the same pixels, of which nothing is read twice."""
    if isinstance(pixels, ArrayPixels):
        # An array stays one: only so can it be told from a colour picture.
        return replace(pixels, items=(pixels.items[pixels.position],), position=0)
    return _Remembered(pixels)


def _identified(pixels: Pixels, identity: bytes) -> Pixels:
    """Return the same pixels with a fingerprint that costs nothing."""
    if isinstance(pixels, ArrayPixels):
        return _KnownArray(pixels.items, pixels.position, pixels.colour_order, identity)
    return _Remembered(pixels, identity)


@dataclass(frozen=True, slots=True)
class _KnownArray(ArrayPixels):
    """An array that was hashed before."""

    identity: bytes

    def fingerprint(self) -> bytes:
        """Return bytes that differ where the pixels do."""
        return self.identity


class _Remembered:
    """Pixels of which nothing is read or decoded twice; arrays are shared, not to be written to."""

    def __init__(self, pixels: Pixels, identity: bytes | None = None) -> None:
        self._pixels = pixels
        self._identity = identity
        self._kept: dict[str, Any] = {}

    def encoded(self) -> bytes | None:
        """Return the bytes of the picture file, None where there is no such file."""
        return self._once("encoded", self._pixels.encoded)  # type: ignore[no-any-return]

    def grey(self, path: GreyPath) -> ImageArray:
        """Return uint8 (height, width)."""
        return self._once(path, lambda: self._pixels.grey(path))  # type: ignore[no-any-return]

    def rgb(self) -> ImageArray:
        """Return uint8 (height, width, 3)."""
        return self._once("rgb", self._pixels.rgb)  # type: ignore[no-any-return]

    def fingerprint(self) -> bytes:
        """Return bytes that differ where the pixels do."""
        if self._identity is not None:
            return self._identity
        return self._pixels.fingerprint()

    def _once(self, what: str, make: Any) -> Any:
        if what not in self._kept:
            self._kept[what] = make()
        return self._kept[what]


def one_line_reason(error: BaseException) -> str:
    """Return what went wrong in one line; other people's errors with their kind."""
    text = " ".join(str(error).split()) or "no reason given"
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"
