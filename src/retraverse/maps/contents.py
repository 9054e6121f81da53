"""What a map holds, apart from the object users have: gathered, written, read back."""

import hashlib
import itertools
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from retraverse.errors import InputError
from retraverse.maps.describe import DescribedFrame, Describer, Frames
from retraverse.maps.frame_table import FrameTable
from retraverse.maps.manifest import Manifest, SegmentFile
from retraverse.maps.provenance import Step, TechniqueRecord
from retraverse.maps.segment import Segment
from retraverse.maps.storage import MapWriter, StoredMap, read_map
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.techniques import Technique
from retraverse.types import Array, Progress

__all__ = [
    "Contents",
    "check_columns",
    "describe_positioned",
    "new_step",
    "read_back",
    "write_contents",
]


@dataclass(frozen=True)
class Contents:
    """What a map holds at one time; growing replaces all of it at once."""

    segments: tuple[Segment, ...]
    history: tuple[Step, ...]
    position_columns: int
    thumbnails: ThumbnailSpec | None
    manifest: Manifest | None
    """As on disk; None in memory."""

    @classmethod
    def of(cls, stored: StoredMap) -> "Contents":
        """Return what a map on disk holds."""
        manifest = stored.manifest
        return cls(
            segments=stored.segments,
            history=manifest.history,
            position_columns=manifest.position_columns,
            thumbnails=manifest.thumbnails,
            manifest=manifest,
        )

    @cached_property
    def frames(self) -> FrameTable:
        """The frames of all segments."""
        return FrameTable.concatenate([segment.frames for segment in self.segments])

    @cached_property
    def starts(self) -> list[int]:
        """The first row of each segment, then the number of rows."""
        return list(itertools.accumulate((len(segment) for segment in self.segments), initial=0))

    @cached_property
    def content_sha256(self) -> str:
        """The hash of all names and pictures, as `Traverse.content_hash` makes it."""
        if self.manifest is not None:
            return self.manifest.content_sha256
        return hashlib.sha256(b"".join(map(_content_digests, self.segments))).hexdigest()

    def technique_record(self, technique: Technique) -> TechniqueRecord:
        """Return what made these descriptions: as the disk says, else `technique`."""
        return TechniqueRecord.of(technique) if self.manifest is None else self.manifest.technique


def _content_digests(segment: Segment) -> bytes:
    """Return two digests a frame, its name's and its picture's, end to end."""
    names = (name.encode("utf-8", "surrogateescape") for name in segment.frames.names)
    pairs = zip(names, segment.content, strict=True)
    return b"".join(hashlib.sha256(name).digest() + row.tobytes() for name, row in pairs)


def read_back(path: Path, technique: Technique) -> Contents:
    """Return what has just been written."""
    return Contents.of(read_map(path, technique=technique, verify=False))


def new_step(action: str, frames: Frames) -> Step:
    """Return the note that a map keeps of `frames` being added now."""
    source = str(getattr(frames, "source", "frames in memory"))
    return Step.now(action, source, len(frames))


def describe_positioned(
    frames: Frames,
    technique: Technique,
    metres: Array | None,
    thumbnails: ThumbnailSpec | None,
    describer: Describer,
    progress: Progress,
) -> Generator[DescribedFrame, None, None]:
    """Yield the described frames, with their positions."""
    with closing(
        describer(frames, technique, thumbnails=thumbnails, progress=progress)
    ) as described:
        for row, frame in enumerate(described):
            if metres is not None:
                position = tuple(metres[row].tolist())
                frame = replace(frame, record=replace(frame.record, position=position))
            yield frame


def check_columns(metres: Array | None, expected: int) -> None:
    """Refuse positions where the map has none, or other ones."""
    got = 0 if metres is None else metres.shape[1]
    if got != expected:
        kinds = ("no positions", "positions along the route (N,)", "positions (N, 2)")
        raise InputError(f"positions: got {kinds[got]}, but the map has {kinds[expected]}")


def write_contents(
    writer: MapWriter,
    fresh: Iterable[Segment],
    technique: Technique,
    contents: Contents,
    kept: tuple[Segment, ...] = (),
) -> None:
    """Write the `fresh` segments behind those `kept` on disk, and make them the map."""
    digest = hashlib.sha256()
    for segment in kept:
        digest.update(_content_digests(segment))
    files: list[SegmentFile] = []
    if kept and contents.manifest is not None:
        files.extend(contents.manifest.segments[: len(kept)])
    for segment in fresh:
        files.append(writer.add(segment, len(files)))
        digest.update(_content_digests(segment))
    writer.commit(
        Manifest(
            technique=contents.technique_record(technique),
            history=contents.history,
            content_sha256=digest.hexdigest(),
            position_columns=contents.position_columns,
            thumbnails=contents.thumbnails,
            segments=tuple(files),
        )
    )
