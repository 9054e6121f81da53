"""One writer at a time: an flock on the file ``.lock`` in a map's folder.

The system drops the lock when its holder dies, however it dies. The file itself stays.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from retraverse.errors import MapError
from retraverse.maps.files import one_line

__all__ = ["LOCK", "locked"]

LOCK = ".lock"


@contextmanager
def locked(
    folder: Path, destination: Path, *, create: bool = False
) -> Iterator[Callable[[], bool]]:
    """Hold the lock of `folder`; gives a function that tells whether the folder is still ours.

    Parameters
    ----------
    folder : Path
        Holds the lock file.
    destination : Path
        The map's place, for the message.
    create : bool
        Whether the folder is made.

    Raises
    ------
    MapError
        If another writer holds it.
    """
    with one_line(destination, "locked for writing"):
        opened = _acquire(folder, destination, create)
    try:
        yield lambda: _is_at(opened, folder)
    finally:
        os.close(opened)


def _acquire(folder: Path, destination: Path, create: bool) -> int:
    import fcntl

    while True:
        if create:
            folder.mkdir(exist_ok=True)
        try:
            opened = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        except FileNotFoundError:
            if not create:
                raise
            continue  # Its last user removed the folder between our two steps.
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(opened)
            raise MapError(
                f"{destination}: another process is writing this map; wait until it is done"
            ) from error
        except BaseException:
            os.close(opened)
            raise
        if _is_at(opened, folder):
            return opened
        os.close(opened)  # We locked a file that its last user had just removed or moved.


def _is_at(opened: int, folder: Path) -> bool:
    """Tell whether the open lock file is the one that lies in `folder` now."""
    try:
        return os.path.samestat(os.fstat(opened), (folder / LOCK).stat())
    except FileNotFoundError:
        return False
