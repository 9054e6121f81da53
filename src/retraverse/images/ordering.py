"""The order people expect file names in: ``2.jpg`` before ``10.jpg``."""

import re
from pathlib import PurePath

__all__ = ["natural_key"]

_NUMBER = re.compile("([0-9]+)")

_PartKey = tuple[str | tuple[int, str], ...]


def natural_key(path: str | PurePath) -> tuple[tuple[_PartKey, ...], str]:
    """Return a sort key under which numbers inside names count as numbers.

    Folders are compared before the files in them, letters without regard to case, a
    name before its own continuation (``frame.jpg`` before ``frame2.jpg``). Names that
    differ only in case or leading zeros are told apart by the text itself, so the order
    is total: it never depends on the order of the input.

    Parameters
    ----------
    path : str or PurePath
        A file name or a path.

    Returns
    -------
    key : tuple
        Compare it only with other keys of this function.

    Examples
    --------
    >>> sorted(["10.jpg", "2.jpg", "1.jpg"], key=natural_key)
    ['1.jpg', '2.jpg', '10.jpg']
    """
    whole = PurePath(path)
    # The suffix is a part of its own, or "." would be compared with the digits of longer names.
    parts = (*whole.parts[:-1], whole.stem, whole.suffix)
    return tuple(_part_key(part) for part in parts), str(path)


def _part_key(part: str) -> _PartKey:
    """Alternate text and numbers, always beginning with (maybe empty) text."""
    pieces = _NUMBER.split(part.casefold())
    return tuple(_number_key(piece) if i % 2 else piece for i, piece in enumerate(pieces))


def _number_key(digits: str) -> tuple[int, str]:
    """Order digit strings of any length as numbers: `int` refuses very long ones."""
    significant = digits.lstrip("0")
    return len(significant), significant
