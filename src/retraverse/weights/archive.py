"""One file out of a zip or tar archive that nobody vouches for.

The name that the archive gives the file is never used as a path, links and devices are refused,
and the bytes are counted while they come: a small archive cannot fill the disk.
"""

import contextlib
import errno
import fnmatch
import lzma
import os
import secrets
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from retraverse.errors import InputError
from retraverse.weights.checksum import LARGEST_BYTES

__all__ = ["extract_member", "is_archive"]

COPY_BYTES = 1 << 20
LISTED = 5
"""Names of an archive's files that an error message shows."""


def is_archive(path: Path) -> bool:
    """Tell whether a file is a zip or a tar archive.

    PyTorch's own files are zip archives too: ask only where an archive is expected.
    """
    return zipfile.is_zipfile(path) or tarfile.is_tarfile(path)


def extract_member(
    archive: Path, pattern: str, target: Path, *, largest: int = LARGEST_BYTES
) -> None:
    """Write the one file of an archive whose name fits a pattern.

    Parameters
    ----------
    archive : Path
        Zip, or tar of any compression.
    pattern : str
        Its name in the archive; ``*`` stands for any text.
    target : Path
        Where it goes; whole, or not there.
    largest : int
        Bytes it may have.

    Raises
    ------
    InputError
        If the archive is damaged, or has no such file, or several, or one too large.
    """
    temporary = target.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with _plain_errors(archive), _open_member(archive, pattern) as source:
            _copy(source, temporary, largest, archive)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def _plain_errors(archive: Path) -> Iterator[None]:
    try:
        yield
    except (zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, EOFError) as error:
        raise InputError(f"{archive}: damaged archive ({error}); fetch it again") from error
    except OSError as error:
        # gzip and bzip2 complain of damage without a number; a damaged table of contents may send
        # the reader before the file's beginning. All else is the disk's.
        if error.errno not in (None, errno.EINVAL):
            raise
        raise InputError(f"{archive}: damaged archive ({error}); fetch it again") from error
    except (NotImplementedError, RuntimeError) as error:
        raise InputError(f"{archive}: cannot be unpacked ({error})") from error


@contextlib.contextmanager
def _open_member(archive: Path, pattern: str) -> Iterator[IO[bytes]]:
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as zipped:
            names = [info.filename for info in zipped.infolist() if not info.is_dir()]
            with zipped.open(_only(archive, pattern, names)) as source:
                yield source
    elif tarfile.is_tarfile(archive):
        with tarfile.open(archive) as tarred:
            # Links and devices are no files here: what they point at is not in the archive.
            files = {member.name: member for member in tarred if member.isreg()}
            packed = tarred.extractfile(files[_only(archive, pattern, list(files))])
            if packed is None:
                raise InputError(f"{archive}: {pattern} is no plain file")
            yield packed
    else:
        raise InputError(f"{archive}: no zip or tar archive; a web page saved instead of the file?")


def _only(archive: Path, pattern: str, names: list[str]) -> str:
    fitting = [name for name in names if fnmatch.fnmatchcase(name, pattern)]
    if len(fitting) != 1:
        shown = ", ".join(fitting or names) if len(names) <= LISTED else f"{len(names)} files"
        raise InputError(
            f"{archive}: {len(fitting)} files fit {pattern!r}, expected one of: {shown}"
        )
    return fitting[0]


def _copy(source: IO[bytes], target: Path, largest: int, archive: Path) -> None:
    done = 0
    with target.open("xb") as file:
        while part := source.read(COPY_BYTES):
            done += len(part)
            if done > largest:
                raise InputError(f"{archive}: unpacks to more than {largest} bytes; refused")
            file.write(part)
        file.flush()
        os.fsync(file.fileno())
