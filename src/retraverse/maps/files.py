"""The few file operations that maps are made of, each of which either happens or says why not."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from retraverse.errors import MapError, RetraverseError

__all__ = [
    "created",
    "flush_folder",
    "one_line",
    "open_folder",
    "open_regular",
    "read_regular",
    "write_all",
]

WRITE_BYTES = 1 << 24


@contextmanager
def one_line(path: Path, doing: str) -> Iterator[None]:
    """Turn the system's errors into a `MapError` of one line: "route.map: cannot be written: …"."""
    try:
        yield
    except RetraverseError:
        raise
    except OSError as error:
        raise MapError(f"{path}: cannot be {doing}: {error.strerror or error}") from error


@contextmanager
def open_folder(path: Path) -> Iterator[int]:
    """Open a folder, refusing one that is a link to elsewhere.

    Raises
    ------
    MapError
        If it is none.
    """
    try:
        folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise MapError(f"{path}: not a folder that can be opened: {error.strerror}") from error
    try:
        yield folder
    finally:
        os.close(folder)


@contextmanager
def open_regular(folder: int, name: str, what: str) -> Iterator[int]:
    """Open a plain file inside an open folder for reading; never through a symbolic link.

    Raises
    ------
    MapError
        If there is none, or it is a link, a folder, a pipe; the message starts with `what`.
    """
    try:
        # Without O_NONBLOCK a named pipe would keep us waiting for its writer.
        file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    except OSError as error:
        raise MapError(f"{what}: cannot be opened: {error.strerror}; was it removed?") from error
    try:
        if not stat.S_ISREG(os.fstat(file).st_mode):
            raise MapError(f"{what}: not a plain file; expected one that this program wrote")
        yield file
    finally:
        os.close(file)


def read_regular(folder: Path, name: str, first: bytes = b"") -> bytes:
    """Return the bytes of a plain file in `folder`; errors as in `open_regular`.

    A file that does not start with `first` gives only its start: the rest is not worth reading.
    """
    directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with (
            open_regular(directory, name, f"{folder / name}") as file,
            os.fdopen(file, "rb", closefd=False) as stream,
        ):
            start = stream.read(len(first))
            return start + stream.read() if start == first else start
    finally:
        os.close(directory)


@contextmanager
def created(path: Path) -> Iterator[int]:
    """Open a new file for writing, and have it on the disk when the block ends well."""
    target = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o666)
    try:
        yield target
        os.fsync(target)
    finally:
        os.close(target)


def write_all(target: int, content: bytes | memoryview) -> None:
    """Write every byte; one system call may write fewer than it was given."""
    rest = memoryview(content)
    while len(rest):
        rest = rest[os.write(target, rest[:WRITE_BYTES]) :]


def flush_folder(folder: Path) -> None:
    """Have the names in `folder` on the disk, not only the files' bytes."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
