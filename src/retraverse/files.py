"""Files that are whole or not there."""

import os
import secrets
from pathlib import Path

from retraverse.errors import DataMissingError, InputError

__all__ = ["check_writable_place", "write_whole"]


def write_whole(path: Path, content: bytes) -> None:
    """Write a file beside its place, then rename: a reader sees the old one or the new one.

    On any error, a full disk or Ctrl-C among them, the file that was there stays and nothing
    half-written is left beside it.
    """
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def check_writable_place(path: Path) -> None:
    """Raise unless a file can be put at `path`: asked before long work, not after it.

    Raises
    ------
    DataMissingError
        If its folder does not exist.
    InputError
        If it is a folder itself, or its folder may not be written to.
    """
    if not path.parent.is_dir():
        raise DataMissingError(f"cannot write {path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder, expected a file name")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"cannot write {path}: the folder {path.parent} is not yours to write")
