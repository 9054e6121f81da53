"""Regional convolutional matching: the kernel under CoHOG and ConvSequential-SLAM.

Conventions: descriptors are rows, ``(regions, length)``; a query has G regions, each of R
references N. Rows of the result are weightings, columns references.

Contents: `regional_scores`, `quantise_regions`.

Source: ConvSequential-SLAM thesis, section 3.2.4, algorithm 1; the matching is that of CoHOG
(M. Zaffar, S. Ehsan, M. Milford, K. McDonald-Maier, IEEE RA-L 5(2), 2020).
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.kernels import numpy_regional
from retraverse.kernels.backend import default_threads, instruction_sets, native
from retraverse.types import Array, FloatArray

__all__ = ["quantise_regions", "regional_scores"]

# 255 * 255 * length must stay below 2^31, the largest sum the integer kernels hold.
_LONGEST_UINT8 = 33_000


def regional_scores(
    query: Array,
    references: Array,
    weights: FloatArray,
    *,
    threads: int | None = None,
    instruction_set: str | None = None,
) -> FloatArray:
    """Return how well the regions of a query are found again in each reference.

    ``out[m, r] = sum over g of weights[m, g] * max over n of <query[g], references[r, n]>``:
    every query region takes its best match in the reference, wherever that lies, and each row of
    weights sums these up in its own way. With weights 1/k on the k regions of interest and 0
    elsewhere, a row is the score of regional convolutional matching.

    Parameters
    ----------
    query : float32 or uint8 array, shape (G, L)
        Region descriptors, usually non-negative and of length 1; uint8 as of `quantise_regions`.
    references : array of the same type, shape (R, N, L), C-contiguous
        May be memory-mapped. R may be 0.
    weights : float32 array, shape (M, G)
        A region whose weight is 0 in every row costs nothing.
    threads : int, optional
        At least 1; None = `default_threads`. The result is the same, bit for bit, on any number.
    instruction_set : str, optional
        One of `instruction_sets`: nothing newer is used. None = the newest.

    Returns
    -------
    scores : float32 array, shape (M, R)
        For uint8 in units of 1, that is divided by 255 squared.

    Raises
    ------
    ShapeError
        An array has the wrong number of axes, size, type or layout.
    InputError
        An array holds NaN or infinity; the message names the first such reference.
    ConfigError
        `threads` or `instruction_set` is not possible here.

    Notes
    -----
    Work is G' N L multiplications a reference, G' the regions with a weight. float32 results
    agree between avx2, avx512 and neon bit for bit; plain and NumPy round elsewhere (1e-6).
    uint8 products are exact integers.

    Examples
    --------
    >>> query = np.eye(2, 4, dtype=np.float32)
    >>> references = np.stack([np.eye(2, 4, dtype=np.float32), np.zeros((2, 4), np.float32)])
    >>> regional_scores(query, references, np.full((1, 2), 0.5, np.float32))
    array([[1., 0.]], dtype=float32)
    """
    _check_arrays(query, references, weights)
    threads = default_threads() if threads is None else threads
    _check_how(threads, instruction_set)
    out = np.empty((weights.shape[0], references.shape[0]), np.float32)
    if out.size:
        kernel = native() or numpy_regional
        query, weights = np.ascontiguousarray(query), np.ascontiguousarray(weights)
        bad = kernel.regional_scores(
            query, references, weights, out, threads, instruction_set or ""
        )
        if bad >= 0:
            raise InputError(f"references[{bad}] holds NaN or infinity, expected finite values")
    return out


def quantise_regions(descriptors: Array) -> NDArray[np.uint8]:
    """Return descriptors as bytes: value * 255, rounded to the nearest, halves to even.

    A byte is wrong by at most 1/510, a product of two unit descriptors by a few thousandths; over
    the regions of an image that averages out: scores of regional HOG move by about 1e-4.

    Parameters
    ----------
    descriptors : float array, any shape, values in [0, 1]

    Raises
    ------
    InputError
        A value is negative, above 1 (by more than rounding, 1e-5) or NaN.
    """
    low, high = descriptors.min(initial=0), descriptors.max(initial=0)
    if not (low >= 0 and high <= 1 + 1e-5):
        raise InputError(
            f"descriptors reach from {low:.6g} to {high:.6g}, expected values in [0, 1]; "
            "only non-negative descriptors of length 1 can be stored as bytes"
        )
    levels: Array = np.rint(np.minimum(descriptors, 1) * 255)
    return levels.astype(np.uint8)


def _check_arrays(query: Array, references: Array, weights: FloatArray) -> None:
    _check_axes(query, references, weights)
    if query.dtype not in (np.float32, np.uint8) or query.dtype != references.dtype:
        raise ShapeError(
            f"query is {query.dtype} and references are {references.dtype}, "
            "expected both float32 or both uint8"
        )
    if weights.dtype != np.float32:
        raise ShapeError(f"weights are {weights.dtype}, expected float32")
    if not references.flags.c_contiguous:
        raise ShapeError("references are not C-contiguous; np.ascontiguousarray copies them")
    if query.dtype == np.uint8 and query.shape[1] > _LONGEST_UINT8:
        raise ShapeError(f"uint8 descriptors have {query.shape[1]} values, at most 33000 can be")
    _check_finite(query, weights)


def _check_axes(query: Array, references: Array, weights: Array) -> None:
    fits = query.ndim == weights.ndim == 2 and references.ndim == 3
    fits = fits and query.shape[1] == references.shape[2] and weights.shape[1] == query.shape[0]
    if not fits:
        raise ShapeError(
            f"query {query.shape}, references {references.shape} and weights {weights.shape} "
            "do not fit, expected (G, L), (R, N, L) and (M, G)"
        )
    if 0 in query.shape or references.shape[1] == 0:
        raise ShapeError(
            f"query {query.shape} or references {references.shape} have no region or no values; "
            "a picture too small for one region has no descriptor"
        )


def _check_finite(query: Array, weights: FloatArray) -> None:
    for name, array in (("query", query), ("weights", weights)):
        if array.dtype == np.float32 and not np.isfinite(array).all():
            raise InputError(f"{name} holds NaN or infinity, expected finite values")


def _check_how(threads: int, instruction_set: str | None) -> None:
    if threads < 1:
        raise ConfigError(f"threads is {threads}, expected at least 1")
    if instruction_set is not None and instruction_set not in instruction_sets():
        available = ", ".join(instruction_sets()) or "none (the NumPy twins run)"
        raise ConfigError(f"instruction set {instruction_set!r} is not here: {available}")
