"""Maps as folders: reading them without a lock, writing them so that nothing can halve them.

A map on disk is::

    route.map/
      manifest.json                             what belongs to the map; decides
      segments/000000-<hash>.safetensors ...    frames in route order
      .lock                                     empty; a writer holds an flock on it

How a write goes, so that whoever looks at any instant finds the old map or the new one:

1. New segments are written beside the old under other names, each to ``*.partial``, flushed
   to the disk, then renamed; their folder is flushed.
2. The manifest is written to ``manifest.json.partial``, flushed, and renamed over the old one:
   this instant is the change. The folder is flushed.
3. Files the manifest does not name are removed.

A new map goes through the same steps in ``.<name>.partial`` beside its place and is renamed
there, folder and all. Whatever a killed writer left, the next one removes. Readers that have
mapped old segments keep them: POSIX removes a file's name, not its bytes in use.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from retraverse.errors import DataMissingError, MapError
from retraverse.maps.describe import in_order
from retraverse.maps.files import (
    created,
    flush_folder,
    one_line,
    open_folder,
    open_regular,
    read_regular,
    write_all,
)
from retraverse.maps.lock import LOCK, locked
from retraverse.maps.manifest import OPENING, Manifest, SegmentFile, is_segment_name
from retraverse.maps.segment import Segment
from retraverse.maps.tensor_file import map_tensors, write_tensors
from retraverse.techniques import Layout, Technique
from retraverse.types import Progress, no_progress

__all__ = ["MapWriter", "StoredMap", "changing_map", "new_map", "read_manifest", "read_map"]

MANIFEST = "manifest.json"
SEGMENTS = "segments"
PARTIAL = ".partial"
ATTEMPTS = 100
"""How often a reader starts over because a writer replaced the map under its eyes."""


@dataclass(frozen=True)
class StoredMap:
    """A map as read from disk."""

    manifest: Manifest
    technique: Technique
    segments: tuple[Segment, ...]


def read_manifest(path: Path) -> Manifest:
    """Return the manifest of the map at `path`.

    Raises
    ------
    DataMissingError
        If there is nothing.
    MapError
        If it is no map, or the manifest is damaged.
    """
    with one_line(path, "read"):
        if not path.exists():
            raise DataMissingError(f"{path}: no such map; build it first, or correct its name")
        if not path.is_dir():
            raise MapError(f"{path}: a map is a folder, got a file; is this a picture or a video?")
        if not (path / MANIFEST).exists():
            raise MapError(
                f"{path}: not a route map: it has no {MANIFEST}; expected a folder made by "
                "`map build` (is this a folder of pictures?)"
            )
        content = read_regular(path, MANIFEST, OPENING)
    return Manifest.parse(content, f"{path / MANIFEST}")


def read_map(
    path: Path,
    *,
    technique: Technique | None = None,
    verify: bool = True,
    progress: Progress = no_progress,
) -> StoredMap:
    """Return the map at `path`; parameters and errors as in `load_map`."""
    for attempt in range(ATTEMPTS):
        manifest = read_manifest(path)
        try:
            return _read_segments(path, manifest, technique, verify, progress)
        except MapError:
            # A writer may have replaced the map, and removed its old files, since we looked.
            if attempt + 1 == ATTEMPTS or read_manifest(path) == manifest:
                raise
    raise AssertionError("unreachable")


def _read_segments(
    path: Path,
    manifest: Manifest,
    technique: Technique | None,
    verify: bool,
    progress: Progress,
) -> StoredMap:
    if technique is None:
        technique = manifest.technique.restore(f"{path}")
    else:
        manifest.technique.require(technique, f"{path}")
    layout = technique.layout
    with one_line(path, "read"), open_folder(path / SEGMENTS) as folder:

        def read(file: SegmentFile) -> Segment:
            return _read_segment(
                folder, path / SEGMENTS / file.name, file, manifest, layout, verify
            )

        reading = in_order(read, manifest.segments)
        watched = progress(reading, total=len(manifest.segments), label="reading the map")
        return StoredMap(manifest, technique, tuple(watched))


def _read_segment(
    folder: int, what: Path, file: SegmentFile, manifest: Manifest, layout: Layout, verify: bool
) -> Segment:
    specs = Segment.tensor_specs(
        file.n_frames,
        layout,
        position_columns=manifest.position_columns,
        has_thumbnails=manifest.thumbnails is not None,
    )
    with open_regular(folder, file.name, f"{what}") as opened:
        tensors = map_tensors(opened, file.seal, specs, what=f"{what}", verify=verify)
    return Segment.from_tensors(tensors, f"{what}")


class MapWriter:
    """Writes segments into the folder of a map, then makes them the map.

    Got from `new_map` or `changing_map`, which hold the lock and clear up.
    """

    def __init__(self, folder: Path, destination: Path) -> None:
        self._folder = folder
        self._destination = destination

    def add(self, segment: Segment, number: int) -> SegmentFile:
        """Write one segment to the disk; it is no part of the map before `commit`.

        Raises
        ------
        MapError
            If the disk is full, say.
        """
        partial = self._folder / SEGMENTS / f"{number:06d}{PARTIAL}"
        with one_line(self._destination, "written"):
            with created(partial) as target:
                seal = write_tensors(target, segment.tensors())
            name = f"{number:06d}-{seal.sha256[:16]}.safetensors"
            partial.replace(partial.with_name(name))
        return SegmentFile(name, len(segment), seal)

    def commit(self, manifest: Manifest) -> None:
        """Make `manifest` the map, in one instant.

        Raises
        ------
        MapError
            If the disk is full, say, or something else took the place of a new map.
        """
        partial = self._folder / (MANIFEST + PARTIAL)
        with one_line(self._destination, "written"):
            flush_folder(self._folder / SEGMENTS)
            with created(partial) as target:
                write_all(target, manifest.render())
            partial.replace(self._folder / MANIFEST)
            flush_folder(self._folder)
            if self._folder != self._destination:
                # Replaces nothing but an empty folder.
                self._folder.rename(self._destination)
                flush_folder(self._destination.parent)


@contextmanager
def new_map(path: Path, *, overwrite: bool = False) -> Iterator[MapWriter]:
    """Give a writer for a map that is not there yet, or replaces one.

    Parameters
    ----------
    path : Path
        Where the map will be; its parent must exist.
    overwrite : bool
        Whether a map that is there is replaced; anything else never is.

    Raises
    ------
    DataMissingError
        If the folder that should hold the map does not exist.
    MapError
        If there is something already, or another process writes there.
    """
    path = path.resolve()
    if not path.parent.is_dir():
        raise DataMissingError(f"{path.parent}: no such folder; make it first, to hold {path.name}")
    if not _is_vacant(path):
        if not overwrite:
            raise MapError(f"{path}: exists already; choose another name, or overwrite it")
        with changing_map(path) as writer:
            yield writer
        return
    partial = _sibling(path)
    with locked(partial, path, create=True) as still_ours:
        try:
            with one_line(path, "written"):
                _remove_content(partial)
                (partial / SEGMENTS).mkdir()
            yield MapWriter(partial, path)
        finally:
            if still_ours():
                _remove_folder(partial)


@contextmanager
def changing_map(path: Path, expected: Manifest | None = None) -> Iterator[MapWriter]:
    """Give a writer that changes the map at `path`.

    Parameters
    ----------
    path : Path
        A map.
    expected : Manifest, optional
        What it must hold: adding to a map that somebody else has changed would lose frames.

    Raises
    ------
    DataMissingError, MapError
        If it is no map, has changed, or another process writes it.
    """
    path = path.resolve()
    read_manifest(path)
    with locked(path, path):
        if expected is not None and read_manifest(path) != expected:
            raise MapError(f"{path}: changed on disk since it was loaded; load it again")
        with open_folder(path / SEGMENTS):
            _sweep(path)
        _sweep_sibling(path)
        try:
            yield MapWriter(path, path)
        finally:
            _sweep(path)


def _sibling(path: Path) -> Path:
    """Return where a new map is made before it is renamed to `path`."""
    return path.with_name(f".{path.name}{PARTIAL}")


def _sweep_sibling(path: Path) -> None:
    """Remove what a killed first build left beside `path`, unless it is at work."""
    sibling = _sibling(path)
    if sibling.is_dir():
        with suppress(MapError), locked(sibling, path):
            _remove_folder(sibling)


def _is_vacant(path: Path) -> bool:
    """Tell whether there is nothing at `path`, or an empty folder."""
    return not path.exists() or (path.is_dir() and not any(path.iterdir()))


def _sweep(path: Path) -> None:
    """Remove segments and partial files that the manifest on disk does not name.

    Only files with names that this program gives; what it cannot remove now, the next does.
    """
    with suppress(OSError, MapError):
        named = {file.name for file in read_manifest(path).segments}
        (path / (MANIFEST + PARTIAL)).unlink(missing_ok=True)
        for file in (path / SEGMENTS).iterdir():
            if file.name not in named and _is_ours(file.name):
                file.unlink()


def _is_ours(name: str) -> bool:
    stem = name.removesuffix(PARTIAL)
    return is_segment_name(name) or (stem != name and stem.isdecimal())


def _remove_content(folder: Path) -> None:
    """Remove what a killed writer left in `folder`, all but the lock that we hold."""
    segments = folder / SEGMENTS
    if segments.is_dir() and not segments.is_symlink():
        for file in segments.iterdir():
            file.unlink()
        segments.rmdir()
    for name in (MANIFEST, MANIFEST + PARTIAL):
        (folder / name).unlink(missing_ok=True)


def _remove_folder(folder: Path) -> None:
    # The lock goes last: until then nobody else starts to write here.
    with suppress(OSError):
        _remove_content(folder)
        (folder / LOCK).unlink()
        folder.rmdir()
