"""Making a map of a traverse, and opening one that was made."""

import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from retraverse.maps.contents import (
    Contents,
    describe_positioned,
    new_step,
    read_back,
    write_contents,
)
from retraverse.maps.describe import Describer, Frames, count_frames, describe_frames
from retraverse.maps.frame_table import read_positions
from retraverse.maps.route_map import RouteMap
from retraverse.maps.segment import gather
from retraverse.maps.storage import new_map, read_map
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.techniques import Technique
from retraverse.types import Array, Progress, no_progress

__all__ = ["build_map", "load_map"]


def build_map(
    reference: Frames,
    technique: Technique,
    *,
    path: str | os.PathLike[str] | None = None,
    positions: Array | Sequence[object] | None = None,
    thumbnails: int | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    describer: Describer | None = None,
    progress: Progress = no_progress,
) -> RouteMap:
    """Describe a reference traverse and return its map.

    Parameters
    ----------
    reference : Traverse or sequence of Frame
        The earlier drive, in the order driven.
    technique : Technique
        How frames are described, here and later for queries.
    path : path, optional
        Where on disk the map is built, piece by piece, so that a route longer than memory
        fits (about 100 MB are held besides the pictures). Default: in memory.
    positions : float array, shape (N,) or (N, 2), optional
        Metres along the route, or east and north; one row per frame.
    thumbnails : int in [16, 4096], optional
        Longest side in pixels of the small JPEG pictures kept with the map. Default: none.
    overwrite : bool
        Whether a map already at `path` is replaced; anything else there is always refused.
    threads : int >= 1, optional
        How many frames are described at once; default: the cores this process may use. The
        map does not depend on it.
    describer : Describer, optional
        Who describes the frames in place of threads, such as worker processes.
    progress : Progress
        Watches the frames.

    Raises
    ------
    InputError
        If there are no frames, or positions or thumbnails make no sense.
    FrameReadError
        If a picture cannot be read; nothing is left on disk.
    MapError
        If something is at `path`, another process writes it, or the disk is full.

    Notes
    -----
    Kill -9 at any instant leaves at `path` what was there before, or the whole new map.
    """
    metres = read_positions(positions, count_frames(reference))
    contents = Contents(
        segments=(),
        history=(new_step("build", reference),),
        position_columns=0 if metres is None else metres.shape[1],
        thumbnails=None if thumbnails is None else ThumbnailSpec(thumbnails),
        manifest=None,
    )
    described = describe_positioned(
        reference,
        technique,
        metres,
        contents.thumbnails,
        describer or partial(describe_frames, threads=threads),
        progress,
    )
    with closing(described):
        segments = gather(described, technique.layout)
        if path is None:
            return RouteMap(technique, replace(contents, segments=tuple(segments)), None)
        with new_map(Path(path), overwrite=overwrite) as writer:
            write_contents(writer, segments, technique, contents)
    place = Path(path).resolve()
    return RouteMap(technique, read_back(place, technique), place)


def load_map(
    path: str | os.PathLike[str],
    *,
    technique: Technique | None = None,
    verify: bool = True,
    progress: Progress = no_progress,
) -> RouteMap:
    """Open a map on disk; its descriptors are mapped, not read into memory.

    Parameters
    ----------
    path : path
        The map's folder.
    technique : Technique, optional
        The one that must have made the map. Default: whichever did, with its parameters.
    verify : bool
        Compare every file with its checksum, which reads all of it (about 1 GB a second and
        core). Without, the manifest is still verified, and of every segment the size, the
        header and the frame table's form: damage inside descriptors goes unnoticed.
    progress : Progress
        Watches the segments.

    Raises
    ------
    DataMissingError
        If there is nothing at `path`.
    MapError
        If it is no map, truncated, edited or foreign; written by a newer program; or made
        with a technique, version or parameters other than `technique` or this program's.

    Notes
    -----
    No lock is needed: a map that is replaced or grown meanwhile stays as it was loaded.
    Checksums find damage; they do not prove who made the map. Nothing in a map is executed.
    """
    place = Path(path).resolve()
    stored = read_map(Path(path), technique=technique, verify=verify, progress=progress)
    return RouteMap(stored.technique, Contents.of(stored), place)
