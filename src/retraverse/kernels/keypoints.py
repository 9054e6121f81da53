"""Matching of binary keypoint descriptors: how many keypoints of two pictures find each other.

Conventions: a descriptor is 256 bits in 32 bytes; a picture has slots for a fixed number of them,
of which its count says how many, from the first, are taken.

Source: E. Rublee, V. Rabaud, K. Konolige, G. Bradski, "ORB: an efficient alternative to SIFT or
SURF", ICCV 2011 (Hamming distance of 256 tests); cross-checked as OpenCV's brute-force matcher.
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.kernels import numpy_keypoints
from retraverse.kernels.backend import default_threads, instruction_sets, native
from retraverse.types import ImageArray

__all__ = ["DESCRIPTOR_BITS", "DESCRIPTOR_BYTES", "MOST_KEYPOINTS", "keypoint_matches"]

DESCRIPTOR_BYTES = 32
DESCRIPTOR_BITS = 256
MOST_KEYPOINTS = 16_000
"""The kernels count keypoints in 16 bits."""


def keypoint_matches(
    queries: ImageArray,
    query_counts: NDArray[np.int32],
    references: ImageArray,
    reference_counts: NDArray[np.int32],
    *,
    max_distance: int = DESCRIPTOR_BITS,
    threads: int | None = None,
    instruction_set: str | None = None,
) -> NDArray[np.int32]:
    """Return how many keypoints of each query and each reference are each other's nearest.

    A pair (i, j) counts when j is the reference keypoint nearest to i, i is the query keypoint
    nearest to j, and they are at most `max_distance` bits apart. Of several equally near
    the first one is nearest: the rule of OpenCV's ``BFMatcher(NORM_HAMMING, crossCheck=True)``.

    Parameters
    ----------
    queries : uint8 array, shape (Q, n, 32)
        Descriptors; slots behind a picture's count are not looked at.
    query_counts : int32 array, shape (Q,)
        Keypoints of each query, 0 to n.
    references : uint8 array, shape (R, m, 32)
        May be memory-mapped.
    reference_counts : int32 array, shape (R,)
        Keypoints of each reference, 0 to m.
    max_distance : int in 0..256
        Pairs further apart are no matches.
    threads : int, optional
        At least 1; None = `default_threads`. The result does not depend on it.
    instruction_set : str, optional
        One of `instruction_sets`: nothing newer is used. None = the newest.

    Returns
    -------
    matches : int32 array, shape (Q, R)

    Raises
    ------
    ShapeError
        An array has the wrong type or size.
    InputError
        A count is negative or larger than the slots there are.
    ConfigError
        `max_distance`, `threads` or `instruction_set` is not possible here.

    Examples
    --------
    >>> picture = np.arange(64, dtype=np.uint8).reshape(1, 2, 32)
    >>> count = np.array([2], np.int32)
    >>> keypoint_matches(picture, count, picture, count)
    array([[2]], dtype=int32)
    """
    _check_pictures("queries", queries, query_counts)
    _check_pictures("references", references, reference_counts)
    threads = default_threads() if threads is None else threads
    _check_how(max_distance, threads, instruction_set)
    out = np.zeros((len(queries), len(references)), np.int32)
    if out.size:
        (native() or numpy_keypoints).keypoint_matches(
            np.ascontiguousarray(queries),
            np.ascontiguousarray(query_counts),
            np.ascontiguousarray(references),
            np.ascontiguousarray(reference_counts),
            out,
            max_distance,
            threads,
            instruction_set or "",
        )
    return out


def _check_pictures(name: str, descriptors: ImageArray, counts: NDArray[np.int32]) -> None:
    slots = descriptors.shape[1] if descriptors.ndim == 3 else -1
    if descriptors.dtype != np.uint8 or slots < 0 or descriptors.shape[2] != DESCRIPTOR_BYTES:
        raise ShapeError(
            f"{name} are {descriptors.dtype} of shape {descriptors.shape}, "
            "expected uint8 (frames, keypoints, 32)"
        )
    if slots > MOST_KEYPOINTS:
        raise ShapeError(f"{name} have {slots} keypoints each, at most {MOST_KEYPOINTS} can be")
    if counts.dtype != np.int32 or counts.shape != (len(descriptors),):
        raise ShapeError(
            f"counts of {name} are {counts.dtype} of shape {counts.shape}, "
            f"expected int32 ({len(descriptors)},)"
        )
    if counts.size and not (counts.min() >= 0 and counts.max() <= slots):
        raise InputError(
            f"counts of {name} reach from {counts.min()} to {counts.max()}, expected 0 to {slots}"
        )


def _check_how(max_distance: int, threads: int, instruction_set: str | None) -> None:
    if not 0 <= max_distance <= DESCRIPTOR_BITS:
        raise ConfigError(f"max_distance is {max_distance}, expected 0 to {DESCRIPTOR_BITS}")
    if threads < 1:
        raise ConfigError(f"threads is {threads}, expected at least 1")
    if instruction_set is not None and instruction_set not in instruction_sets():
        available = ", ".join(instruction_sets()) or "none (the NumPy twins run)"
        raise ConfigError(f"instruction set {instruction_set!r} is not here: {available}")
