"""One door for everything that can go wrong while a foreign file is read."""

import contextlib
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from retraverse.errors import DataMissingError, InputError, MissingExtraError

__all__ = ["HEAD_BYTES", "Budget", "read_head", "read_member", "reading", "whole_content"]

HEAD_BYTES = 4096
"""How much of a file is looked at to tell its format."""


@contextlib.contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn what a parser stumbles over into one `InputError` that names the file.

    Parameters
    ----------
    path : Path
        The file, for the message.
    what : str
        What it is read as, with its article: ``"a caffemodel"``.
    """
    try:
        yield
    except MissingExtraError:
        raise
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"cannot read {path} as {what}: {' '.join(str(error).split())}") from error
    except MemoryError as error:
        raise InputError(f"cannot read {path} as {what}: it needs more memory than there is") from (
            error
        )
    except _parser_errors as error:
        # One line, although libraries and names from the file may have several.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"cannot read {path} as {what}: {reason}; the file is damaged, truncated or of another"
            " kind"
        ) from error


_parser_errors = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    StopIteration,
    TypeError,
    ValueError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


def read_head(path: Path) -> bytes:
    """Return the first `HEAD_BYTES` bytes of a file, fewer if it has fewer.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If it is a folder, empty, or not readable.
    """
    if not path.exists():
        raise DataMissingError(f"no weight file {path}: expected an existing file")
    if not path.is_file():
        raise InputError(f"{path} is not a file, expected a weight file")
    with reading(path, "a weight file"), path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if not head:
        raise InputError(f"{path} is empty, expected a weight file; was its download cut off?")
    return head


def whole_content(path: Path) -> memoryview:
    """Return a file's bytes: read, not mapped, so that nobody can cut them off under us."""
    return memoryview(path.read_bytes())


def read_member(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, n_bytes: int, budget: "Budget"
) -> bytes:
    """Return the first `n_bytes` bytes of a file in a zip archive.

    Raises
    ------
    ValueError
        If it has fewer, is packed in an unusual way, or the budget is spent.
    """
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{member.filename!r} is packed in a way that is not read")
    budget.spend(n_bytes)
    with archive.open(member) as file:
        content = file.read(n_bytes)
    if len(content) != n_bytes:
        raise ValueError(f"{member.filename!r} has {len(content)} bytes of {n_bytes}")
    return content


class Budget:
    """Bytes that what a file unpacks to may still take: no small file fills the memory.

    Parameters
    ----------
    n_bytes : int
        The file's size, or that of what it holds.
    growth : int
        How often larger the unpacked arrays may honestly be.
    """

    def __init__(self, n_bytes: int, growth: int) -> None:
        self._left = (n_bytes + 4096) * growth

    def spend(self, n_bytes: int) -> None:
        """Take `n_bytes` off the budget.

        Raises
        ------
        ValueError
            If that is more than is left.
        """
        self._left -= n_bytes
        if n_bytes < 0 or self._left < 0:
            raise ValueError("it claims to hold more than so many bytes can")
