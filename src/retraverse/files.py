"""Files that are whole or not there."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from retraverse.errors import DataMissingError

__all__ = ["replace_file"]


@contextmanager
def replace_file(path: Path) -> Iterator[TextIO]:
    """Yield a text file that takes the place of `path` once everything is written.

    On any error, a full disk or Ctrl-C among them, the file that was there stays and nothing
    half-written is left beside it.

    Raises
    ------
    DataMissingError
        If the folder does not exist.
    """
    if not path.parent.is_dir():
        raise DataMissingError(f"cannot write {path}: the folder {path.parent} does not exist")
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "w", newline="", encoding="utf-8") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes files that only their owner may read; results are ordinary files.
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(path)
    except BaseException:
        with suppress(FileNotFoundError):
            Path(temporary).unlink()
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
