"""A route map: the descriptions of a reference traverse, with what is needed to use them again.

Conventions
- Row i of everything is frame i of the route, in the order driven.
- Arrays are read-only: a map on disk is memory-mapped, and its pages are read when touched.
"""

import itertools
import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from retraverse.errors import InputError, MapError
from retraverse.maps.contents import (
    Contents,
    check_columns,
    describe_positioned,
    new_step,
    read_back,
    write_contents,
)
from retraverse.maps.describe import Describer, Frames, count_frames, describe_frames
from retraverse.maps.frame_table import FrameTable, read_positions
from retraverse.maps.manifest import FORMAT_VERSION
from retraverse.maps.provenance import Provenance
from retraverse.maps.segment import gather, split_small_end
from retraverse.maps.storage import changing_map, new_map
from retraverse.techniques import Descriptions, Technique
from retraverse.types import Array, Progress, no_progress

__all__ = ["RouteMap"]

BLOCK_BYTES = 64 << 20
"""What `RouteMap.blocks` gives at once unless told otherwise."""


class RouteMap:
    """Descriptions of a reference traverse, in memory or on disk; see `build_map`, `load_map`.

    Examples
    --------
    >>> route = load_map("route.map")  # doctest: +SKIP
    >>> for start, descriptions in route.blocks():  # doctest: +SKIP
    ...     print(start, descriptions.descriptor.shape)
    """

    def __init__(self, technique: Technique, contents: Contents, path: Path | None) -> None:
        self._technique = technique
        self._contents = contents
        self._path = path

    @property
    def technique(self) -> Technique:
        """The technique that described the frames; queries must be described by it too."""
        return self._technique

    @property
    def path(self) -> Path | None:
        """The map's folder; None while it is only in memory."""
        return self._path

    @property
    def n_frames(self) -> int:
        """How many frames the route has."""
        return self._contents.starts[-1]

    def __len__(self) -> int:
        return self.n_frames

    def __repr__(self) -> str:
        where = "in memory" if self._path is None else str(self._path)
        return f"RouteMap({self.n_frames} frames, {self._technique.name}, {where})"

    @property
    def frames(self) -> FrameTable:
        """Name, place in the source, time and position of every frame."""
        return self._contents.frames

    @property
    def positions(self) -> Array | None:
        """Float64 (N, 1) or (N, 2) metres, or None."""
        return self.frames.position

    @property
    def provenance(self) -> Provenance:
        """Where the map came from."""
        contents = self._contents
        record = contents.technique_record(self._technique)
        return Provenance(record, contents.history, contents.content_sha256)

    def with_technique(self, technique: Technique) -> "RouteMap":
        """Return a map in memory of the same descriptions, compared by another technique.

        For a technique that compares the same descriptions otherwise, such as a masked one.

        Raises
        ------
        MapError
            If its descriptions look different.
        """
        if technique.layout != self._technique.layout:
            raise MapError(
                f"map of {self._technique.name}: got {technique.name}, whose descriptions look "
                "different; expected a technique of the same layout"
            )
        return RouteMap(technique, replace(self._contents, manifest=None), None)

    def blocks(self, max_bytes: int = BLOCK_BYTES) -> Iterator[tuple[int, Descriptions]]:
        """Yield consecutive frames' descriptions, with the row each block starts at.

        Parameters
        ----------
        max_bytes : int
            What a block may take; a block has at least one frame, and at most one segment.

        Yields
        ------
        start : int
            Row of the block's first frame.
        descriptions : Descriptions
            Views of the map's own arrays; nothing is copied.
        """
        contents = self._contents
        n_rows = max(1, max_bytes // self._bytes_per_frame)
        for start, segment in zip(contents.starts, contents.segments, strict=False):
            for offset in range(0, len(segment), n_rows):
                yield start + offset, segment.descriptions[offset : offset + n_rows]

    def descriptions(self, start: int = 0, stop: int | None = None) -> Descriptions:
        """Return the descriptions of frames `start` to `stop`, as Python slices count.

        Frames of one segment are a view; more than one segment is copied, so that a long
        map's `blocks` spare memory.
        """
        first, last, _ = slice(start, stop).indices(self.n_frames)
        parts = []
        for begin, segment in zip(self._contents.starts, self._contents.segments, strict=False):
            low, high = max(first - begin, 0), min(last - begin, len(segment))
            if low < high:
                parts.append(segment.descriptions[low:high])
        if not parts:
            return Descriptions.stack([], self._technique.layout)
        return parts[0] if len(parts) == 1 else Descriptions.concatenate(parts)

    def thumbnail(self, row: int) -> bytes | None:
        """Return the small JPEG file of a frame, or None if the map was built without.

        Raises
        ------
        InputError
            If there is no such row.
        """
        if not 0 <= row < self.n_frames:
            raise InputError(f"frame: got row {row}, expected 0 to {self.n_frames - 1}")
        contents = self._contents
        number = next(i for i, end in enumerate(contents.starts[1:]) if row < end)
        return contents.segments[number].thumbnail(row - contents.starts[number])

    def check_technique(self, technique: Technique) -> None:
        """Refuse a technique other than the one the map was made with.

        Raises
        ------
        MapError
            If name, version or a parameter differs; names both.
        """
        record = self._contents.technique_record(self._technique)
        record.require(technique, "the map" if self._path is None else str(self._path))

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        progress: Progress = no_progress,
    ) -> None:
        """Write a copy of the map to disk; this one stays where it is.

        To go on with the copy, `load_map` it.

        Parameters
        ----------
        path : path
            A folder that is not there yet.
        overwrite : bool
            Whether a map already there is replaced; a kill leaves that one or this.

        Raises
        ------
        DataMissingError
            If the folder that should hold the map does not exist.
        MapError
            If something is there, another process writes it, or the disk is full.
        """
        segments = self._contents.segments
        with new_map(Path(path), overwrite=overwrite) as writer:
            watched = progress(segments, total=len(segments), label="saving the map")
            write_contents(writer, watched, self._technique, self._contents)

    def extend(
        self,
        frames: Frames,
        *,
        positions: Array | Sequence[object] | None = None,
        threads: int | None = None,
        describer: Describer | None = None,
        progress: Progress = no_progress,
    ) -> "RouteMap":
        """Add frames to the end of the route and return this map, grown.

        The frames are described with the map's own technique and thumbnail size. A map on
        disk grows there: a kill leaves it as it was or grown. An error changes nothing.

        Parameters
        ----------
        frames : Traverse or sequence of Frame
        positions : float array, shape (N,) or (N, 2), optional
            Metres; needed if, and only if, the map has positions, with as many columns.
        threads : int >= 1, optional
            How many frames are described at once; default: the cores this process may use.
        describer : Describer, optional
            Who describes the frames in place of threads, such as worker processes.
        progress : Progress

        Raises
        ------
        InputError
            If there are no frames, or positions do not go with the map's.
        FrameReadError
            If a picture cannot be read.
        MapError
            If the map changed on disk since it was loaded, another process writes it, or the
            disk is full.
        """
        contents = self._contents
        metres = read_positions(positions, count_frames(frames))
        check_columns(metres, contents.position_columns)
        kept, last = split_small_end(contents.segments)
        grown = replace(contents, history=(*contents.history, new_step("extend", frames)))
        described = describe_positioned(
            frames,
            self._technique,
            metres,
            contents.thumbnails,
            describer or partial(describe_frames, threads=threads),
            progress,
        )
        with closing(described):
            fresh = gather(itertools.chain(last, described), self._technique.layout)
            if self._path is None:
                self._contents = replace(grown, segments=(*kept, *fresh))
            else:
                with changing_map(self._path, contents.manifest) as writer:
                    write_contents(writer, fresh, self._technique, grown, kept)
                self._contents = read_back(self._path, self._technique)
        return self

    def info(self) -> dict[str, Any]:
        """Return what `map info` prints, ready for JSON.

        ``bytes_per_frame`` counts descriptions only; ``total_bytes`` all files, or all arrays.
        """
        contents, provenance = self._contents, self.provenance
        return {
            "path": None if self._path is None else str(self._path),
            "format_version": FORMAT_VERSION,
            "n_frames": self.n_frames,
            "technique": provenance.technique.name,
            "technique_version": provenance.technique.version,
            "parameters": dict(provenance.technique.parameters),
            "layout": dict(provenance.technique.layout),
            "bytes_per_frame": self._bytes_per_frame,
            "total_bytes": self._total_bytes(),
            "n_segments": len(contents.segments),
            "position_columns": contents.position_columns,
            "thumbnail_max_side": contents.thumbnails and contents.thumbnails.max_side,
            "created_at": provenance.created_at,
            "content_sha256": provenance.content_sha256,
            "history": [asdict(step) for step in provenance.history],
        }

    @property
    def _bytes_per_frame(self) -> int:
        return sum(spec.n_bytes for spec in self._technique.layout.arrays.values())

    def _total_bytes(self) -> int:
        manifest = self._contents.manifest
        if manifest is None:
            return sum(segment.n_bytes for segment in self._contents.segments)
        return len(manifest.render()) + sum(file.seal.size for file in manifest.segments)
