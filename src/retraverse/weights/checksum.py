"""Checksums of weight files: what a file must be, and whether it is.

Publishers give SHA-256, SHA-1, or the name that Git gives a file's content (a SHA-1 over a short
header and the content); many give none. One reading of the file computes all three.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from retraverse.errors import InputError

__all__ = ["LARGEST_BYTES", "Seal", "check_file", "describe_mismatch", "seal_file"]

LARGEST_BYTES = 8 << 30
"""No weights file is larger: what would be is refused."""
READ_BYTES = 1 << 20


@dataclass(frozen=True)
class Seal:
    """What is known of a file's content; None where nothing is."""

    n_bytes: int | None = None
    sha256: str | None = None
    """64 hexadecimal digits, lower case; so are the others, with 40."""
    sha1: str | None = None
    git_blob: str | None = None
    """What ``git hash-object FILE`` prints."""

    @property
    def has_checksum(self) -> bool:
        """Whether there is more than a size."""
        return any((self.sha256, self.sha1, self.git_blob))


def seal_file(path: Path) -> Seal:
    """Return size and all checksums of a file, read once."""
    n_bytes = path.stat().st_size
    sha256, sha1 = hashlib.sha256(), hashlib.sha1(usedforsecurity=False)
    blob = hashlib.sha1(b"blob %d\0" % n_bytes, usedforsecurity=False)
    with path.open("rb") as file:
        while part := file.read(READ_BYTES):
            for digest in (sha256, sha1, blob):
                digest.update(part)
    return Seal(n_bytes, sha256.hexdigest(), sha1.hexdigest(), blob.hexdigest())


def describe_mismatch(got: Seal, expected: Seal) -> str | None:
    """Return in words where two seals differ, None where they agree in all that is expected."""
    for what, key in (
        ("bytes", "n_bytes"),
        ("SHA-256", "sha256"),
        ("SHA-1", "sha1"),
        ("Git blob", "git_blob"),
    ):
        wanted, found = getattr(expected, key), getattr(got, key)
        if wanted is not None and found is not None and found != wanted:
            return f"got {what} {found}, expected {wanted}"
    return None


def check_file(path: Path, expected: Seal, what: str) -> Seal:
    """Return the seal of a file that is as expected.

    Parameters
    ----------
    path : Path
    expected : Seal
        Fields that are None are not compared.
    what : str
        Starts the message.

    Raises
    ------
    InputError
        If size or a checksum differs; says both.
    """
    got = seal_file(path)
    problem = describe_mismatch(got, expected)
    if problem:
        raise InputError(f"{what}: {problem}; damaged on its way, or another file")
    return got
