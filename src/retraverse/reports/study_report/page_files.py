"""Writing the many small files of a report."""

import secrets
from pathlib import Path

__all__ = ["put"]


def put(path: Path, content: bytes) -> None:
    """Write a file that a reader sees whole or not at all; one with this content is left alone.

    It is not forced onto the disk: a report can be written again from its records, and waiting for
    the disk a thousand times takes longer than all the rest.
    """
    if path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
