"""Sums of pixel differences: how unlike small pictures are.

Conventions: thumbnails are rows of uint8 pixels; rows of a result are queries, columns
references, and *lower* is more alike: these are distances.

Source: M. Milford, G. Wyeth, "SeqSLAM: Visual Route-Based Navigation for Sunny Summer Days and
Stormy Winter Nights", ICRA 2012, equation 3 (sum of absolute differences).
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, ShapeError
from retraverse.kernels import numpy_thumbnails
from retraverse.kernels.backend import default_threads, instruction_sets, native
from retraverse.types import ImageArray

__all__ = ["Difference", "thumbnail_differences"]

Difference = Literal["absolute", "saturating"]

# 255 times this stays below 2^32, the largest sum the kernels hold.
_MOST_PIXELS = 16_000_000


def thumbnail_differences(
    queries: ImageArray,
    references: ImageArray,
    *,
    difference: Difference = "absolute",
    threads: int | None = None,
    instruction_set: str | None = None,
) -> NDArray[np.uint32]:
    """Return the summed pixel difference of every query and every reference.

    Parameters
    ----------
    queries : uint8 array, shape (Q, P)
        Flattened pictures of P pixels.
    references : uint8 array, shape (R, P)
        May be memory-mapped.
    difference : {"absolute", "saturating"}
        ``|q - r|`` of every pixel, or ``max(q - r, 0)``, which is what subtracting unsigned
        bytes gives in the original SeqSLAM program.
    threads : int, optional
        At least 1; None = `default_threads`. The result does not depend on it.
    instruction_set : str, optional
        One of `instruction_sets`: nothing newer is used. None = the newest.

    Returns
    -------
    differences : uint32 array, shape (Q, R)
        Exact sums, 0 to 255 P.

    Raises
    ------
    ShapeError
        An array is not uint8 with two axes, or they differ in P, or P exceeds 16 million.
    ConfigError
        `difference`, `threads` or `instruction_set` is not possible here.

    Examples
    --------
    >>> a, b = np.array([[10, 20]], np.uint8), np.array([[13, 18]], np.uint8)
    >>> thumbnail_differences(a, b).item(), thumbnail_differences(b, a).item()
    (5, 5)
    >>> thumbnail_differences(a, b, difference="saturating").item()
    2
    """
    _check_arrays(queries, references)
    threads = default_threads() if threads is None else threads
    _check_how(difference, threads, instruction_set)
    out = np.zeros((len(queries), len(references)), np.uint32)
    if out.size and queries.shape[1]:
        (native() or numpy_thumbnails).thumbnail_differences(
            np.ascontiguousarray(queries),
            np.ascontiguousarray(references),
            out,
            difference == "saturating",
            threads,
            instruction_set or "",
        )
    return out


def _check_arrays(queries: ImageArray, references: ImageArray) -> None:
    for name, array in (("queries", queries), ("references", references)):
        if array.dtype != np.uint8 or array.ndim != 2:
            raise ShapeError(
                f"{name} are {array.dtype} of shape {array.shape}, expected uint8 (frames, pixels)"
            )
    if queries.shape[1] != references.shape[1]:
        raise ShapeError(
            f"queries have {queries.shape[1]} pixels and references {references.shape[1]}, "
            "expected equally many (made at another resolution?)"
        )
    if queries.shape[1] > _MOST_PIXELS:
        raise ShapeError(f"pictures have {queries.shape[1]} pixels, at most 16 million can be")


def _check_how(difference: str, threads: int, instruction_set: str | None) -> None:
    if difference not in ("absolute", "saturating"):
        raise ConfigError(f"difference is {difference!r}, expected 'absolute' or 'saturating'")
    if threads < 1:
        raise ConfigError(f"threads is {threads}, expected at least 1")
    if instruction_set is not None and instruction_set not in instruction_sets():
        available = ", ".join(instruction_sets()) or "none (the NumPy twins run)"
        raise ConfigError(f"instruction set {instruction_set!r} is not here: {available}")
