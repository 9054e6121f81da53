"""Folders, patterns and lists of picture files as traverses; what to say where there are none."""

import difflib
import glob
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from retraverse.errors import DataMissingError
from retraverse.images.frame import Frame
from retraverse.images.ordering import natural_key
from retraverse.images.traverse import Traverse

__all__ = [
    "PICTURE_SUFFIXES",
    "is_picture_name",
    "missing_path",
    "open_file_list",
    "open_folder",
    "open_pattern",
]

PICTURE_SUFFIXES = frozenset(
    {
        *(".jpg", ".jpeg", ".jpe", ".png", ".webp", ".bmp", ".dib", ".tif", ".tiff"),
        *(".ppm", ".pgm", ".pbm", ".pnm"),
    }
)
"""What a picture's name ends in, in any case; listings go by it, lists of paths do not."""


def is_picture_name(name: str) -> bool:
    """Return whether a file name is that of a picture, and not hidden."""
    return not name.startswith(".") and Path(name).suffix.lower() in PICTURE_SUFFIXES


def open_folder(folder: Path) -> Traverse:
    """Return the pictures directly in a folder, in natural order.

    Raises
    ------
    DataMissingError
        If there are none; the message says what is there instead.
    """
    try:
        entries = [entry for entry in os.scandir(folder) if not entry.name.startswith(".")]
    except OSError as error:
        raise DataMissingError(f"{folder}: cannot be listed: {error.strerror}") from error
    folders = [entry.name for entry in entries if entry.is_dir()]
    # A link to nowhere is no folder and so stays in: reading it will say what is wrong.
    files = [entry.name for entry in entries if not entry.is_dir()]
    pictures = sorted(filter(is_picture_name, files), key=natural_key)
    if not pictures:
        found = _what_was_found(files, folders)
        raise DataMissingError(f"{folder}: no pictures directly in this folder; {found}")
    frames = [Frame.from_file(folder / name, index=i) for i, name in enumerate(pictures)]
    source = f"folder {folder} ({_count(len(frames), 'picture')})"
    return Traverse(_title(folder), source, tuple(frames))


def open_pattern(pattern: str) -> Traverse:
    """Return the pictures whose paths match a glob pattern, in natural order.

    Raises
    ------
    DataMissingError
        If there are none; the message says what matches instead.
    """
    # pathlib takes no absolute patterns.
    found = [Path(path) for path in glob.glob(pattern, recursive=True)]  # noqa: PTH207
    files = [path for path in found if not path.is_dir()]
    pictures = [path for path in files if is_picture_name(path.name)]
    if not pictures:
        folders = [str(path) for path in found if path.is_dir()]
        instead = _what_was_found([path.name for path in files], folders)
        raise DataMissingError(f"{pattern}: no pictures match this pattern; {instead}")
    pictures.sort(key=natural_key)
    source = f"pattern {pattern} ({_count(len(pictures), 'picture')})"
    return Traverse(_title(_common_folder(pictures)), source, _frames(pictures))


def open_file_list(paths: Sequence[Path]) -> Traverse:
    """Return the pictures at some paths, in the order given, whatever their suffixes."""
    source = f"list of {_count(len(paths), 'file')}"
    return Traverse(_title(_common_folder(paths)), source, _frames(paths))


def missing_path(path: Path) -> DataMissingError:
    """Return the error for a path that is not there, with the name beside it that looks like it."""
    try:
        siblings = [sibling.name for sibling in path.parent.iterdir()]
    except OSError:
        siblings = []
    near = difflib.get_close_matches(path.name, siblings, n=1)
    hint = f"; did you mean {path.parent / near[0]}?" if near else ""
    return DataMissingError(f"{path}: no such file or folder{hint}")


def _frames(paths: Sequence[Path]) -> tuple[Frame, ...]:
    return tuple(
        Frame.from_file(path, name=name, index=index)
        for index, (path, name) in enumerate(zip(paths, _names(paths), strict=True))
    )


def _names(paths: Sequence[Path]) -> list[str]:
    """Name files by themselves, or where two share a name by their paths from the common folder."""
    if len({path.name for path in paths}) == len(set(paths)):
        return [path.name for path in paths]
    common = _common_folder(paths)
    return [path.absolute().relative_to(common).as_posix() for path in paths]


def _common_folder(paths: Sequence[Path]) -> Path:
    return Path(os.path.commonpath([path.absolute().parent for path in paths]))


def _title(folder: Path) -> str:
    return folder.resolve().name or "pictures"


def _what_was_found(files: Sequence[str], folders: Sequence[str]) -> str:
    counts = Counter(Path(name).suffix.lower() or "suffixless" for name in files)
    parts = [_count(count, f"{suffix} file") for suffix, count in counts.most_common(3)]
    parts += [_count(len(folders), "folder")] if folders else []
    found = f"found {', '.join(parts)}" if parts else "found nothing"
    if folders:
        nearest = sorted(folders, key=natural_key)[:3]
        return f"{found}: did you mean {' or '.join(f'{name}/' for name in nearest)}?"
    return f"{found}, expected names ending in {' '.join(sorted(PICTURE_SUFFIXES))}"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"
