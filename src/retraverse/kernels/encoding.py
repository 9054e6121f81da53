"""From grey pixels to regional HOG descriptors and entropies.

Conventions: pictures are uint8 (height, width); regions are numbered row by row,
region (a, b) covering the 2 x 2 cells whose upper left one is (a, b); entropies
in bits, except where divided by the 8 bits of a pixel.

Source: the ConvSequential-SLAM thesis, sections 3.2.2 (entropy map) and 3.2.3
(regional HOG), and the defaults of its authors' program.
"""

from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError, ShapeError
from retraverse.kernels import numpy_encoding
from retraverse.kernels.backend import native
from retraverse.types import Array, FloatArray, ImageArray

__all__ = [
    "MAX_BINS",
    "MAX_RADIUS",
    "Magnitude",
    "Orientation",
    "local_entropy",
    "region_entropies",
    "regional_hog",
]

Orientation = Literal["signed", "unsigned"]
Magnitude = Literal["mean", "euclidean"]

MAX_BINS = 360
MAX_RADIUS = 100
BITS_PER_PIXEL = 8


def regional_hog(
    grey: ImageArray,
    *,
    cell: int = 16,
    bins: int = 8,
    orientation: Orientation = "signed",
    magnitude: Magnitude = "mean",
) -> FloatArray:
    """Return the HOG descriptor of every 2 x 2 block of cells, one cell apart.

    Square-root gamma on the brightest pixel, 5 x 5 Sobel with mirrored borders,
    linear votes into the two nearest orientation bins, no interpolation between
    cells, L2 norm per block without clipping.

    Parameters
    ----------
    grey : uint8 array, shape (S, S)
        The picture, already resized; S is a multiple of `cell`.
    cell : int, at least 2
        Side of a cell in pixels.
    bins : int in 1..360
        Orientation bins per cell.
    orientation : {"signed", "unsigned"}
        Angles over 360 degrees as in the authors' program, or over 180 as in the text.
    magnitude : {"mean", "euclidean"}
        |dx + dy| / 2 as in the authors' program, or sqrt(dx^2 + dy^2).

    Returns
    -------
    descriptors : float32 array, shape ((S / cell - 1)^2, 4 * bins)
        Rows of length 1, all values in [0, 1]; a block without gradient is all zero.
        The four cells of a block come in the order upper left, upper right, lower
        left, lower right. No rows where S is smaller than two cells.

    Raises
    ------
    ShapeError
        If `grey` is not a square uint8 picture or S is not a multiple of `cell`.
    ConfigError
        If a parameter is unknown or outside its range.

    Notes
    -----
    Gamma levels are held in units of 2^-16 grey level, so filtering is exact integer
    arithmetic: flat blocks are zero, never amplified rounding noise.

    References
    ----------
    ConvSequential-SLAM thesis, section 3.2.3; Zaffar et al., "CoHOG", RA-L 2020, section III.
    """
    _check_hog(grey, cell=cell, bins=bins, orientation=orientation, magnitude=magnitude)
    blocks = max(grey.shape[0] // cell - 1, 0)
    descriptors = np.zeros((blocks * blocks, 4 * bins), dtype=np.float32)
    if blocks:
        (native() or numpy_encoding).regional_hog(
            np.ascontiguousarray(grey),
            descriptors,
            cell,
            bins,
            orientation == "signed",
            magnitude == "euclidean",
        )
    return descriptors


def local_entropy(grey: ImageArray, *, radius: int = 5) -> NDArray[np.float64]:
    """Return the entropy, in bits, of the pixel values in a disk around each pixel.

    Pixels of the disk outside the picture are left out. Equal to scikit-image's
    `filters.rank.entropy(grey, disk(radius))`.

    Parameters
    ----------
    grey : uint8 array, shape (H, W)
        The picture; at least one pixel.
    radius : int in 1..100
        The disk is x^2 + y^2 <= radius^2: 81 pixels at 5.

    Returns
    -------
    entropy : float64 array, shape (H, W)
        In [0, log2(pixels of the disk)], at most 8.

    Raises
    ------
    ShapeError
        If `grey` is not a uint8 picture of at least one pixel.
    ConfigError
        If `radius` is outside its range.

    References
    ----------
    ConvSequential-SLAM thesis, section 3.2.2.
    """
    _check_grey(grey)
    _check_range("radius", radius, 1, MAX_RADIUS)
    if grey.size == 0:
        raise ShapeError(f"grey picture has no pixels: shape {grey.shape}")
    entropy = np.empty(grey.shape, dtype=np.float64)
    (native() or numpy_encoding).local_entropy(np.ascontiguousarray(grey), entropy, radius)
    return entropy


def region_entropies(
    entropy_map: NDArray[np.float64], *, size: int = 512, cell: int = 16
) -> tuple[NDArray[np.float64], float]:
    """Return the mean entropy of every region of `regional_hog`, and of the whole picture.

    The same as resizing the map to `size` x `size` (bilinear, as OpenCV does), taking
    the mean over each 2 x 2 cells and dividing by 8. Both steps are linear, so they
    are one small matrix on either side of the map and the large map is never made.

    Parameters
    ----------
    entropy_map : float64 array, shape (H, W)
        From `local_entropy`; usually (100, 100).
    size : int
        Side of the picture that `regional_hog` sees, a multiple of `cell`.
    cell : int, at least 2
        Side of a cell in pixels.

    Returns
    -------
    regions : float64 array, shape ((size / cell - 1)^2,)
        In [0, 1]; none where `size` is smaller than two cells.
    image_entropy : float in [0, 1]
        Mean over the whole resized map.

    Raises
    ------
    ShapeError
        If the map has not two axes or no pixels, or `size` is not a multiple of `cell`.
    ConfigError
        If `cell` is below 2.

    References
    ----------
    ConvSequential-SLAM thesis, section 3.2.2.
    """
    _check_cells(size, cell)
    if entropy_map.ndim != 2 or entropy_map.size == 0:
        raise ShapeError(f"entropy map has shape {entropy_map.shape}; expected (height, width)")
    rows, row_mean = _window_means(entropy_map.shape[0], size, cell)
    columns, column_mean = _window_means(entropy_map.shape[1], size, cell)
    regions = rows @ entropy_map @ columns.T / BITS_PER_PIXEL
    return regions.ravel(), float(row_mean @ entropy_map @ column_mean) / BITS_PER_PIXEL


@cache
def _window_means(length: int, size: int, cell: int) -> tuple[Array, Array]:
    """Weights of an axis of `length` in each window once resized to `size`, and in all of it."""
    resize = _bilinear_weights(length, size)
    starts = range(0, size - 2 * cell + 1, cell)
    windows = [resize[start : start + 2 * cell].mean(axis=0) for start in starts]
    return np.array(windows).reshape(-1, length), resize.mean(axis=0)


def _bilinear_weights(length: int, size: int) -> NDArray[np.float64]:
    """Matrix (size, length) that resizes one axis as OpenCV's INTER_LINEAR does."""
    position = np.clip((np.arange(size) + 0.5) * (length / size) - 0.5, 0, length - 1)
    left = np.minimum(position.astype(np.int64), max(length - 2, 0))
    share = position - left
    weights = np.zeros((size, length))
    rows = np.arange(size)
    weights[rows, left] = 1 - share
    weights[rows, np.minimum(left + 1, length - 1)] += share
    return weights


def _check_hog(grey: Array, *, cell: int, bins: int, orientation: str, magnitude: str) -> None:
    _check_grey(grey)
    _check_range("bins", bins, 1, MAX_BINS)
    _check_choice("orientation", orientation, ("signed", "unsigned"))
    _check_choice("magnitude", magnitude, ("mean", "euclidean"))
    if grey.shape[0] != grey.shape[1]:
        raise ShapeError(f"grey picture is {grey.shape}; expected a square one: resize it first")
    _check_cells(grey.shape[0], cell)


def _check_cells(size: int, cell: int) -> None:
    if cell < 2:
        raise ConfigError(f"cell is {cell}; expected at least 2 pixels")
    if size < 0 or size % cell:
        raise ShapeError(f"picture side is {size}; expected a multiple of the cell, {cell}")


def _check_grey(grey: Array) -> None:
    if grey.ndim != 2 or grey.dtype != np.uint8:
        raise ShapeError(
            f"picture is {grey.dtype} of shape {grey.shape}; expected uint8 (height, width):"
            " was it converted to grey?"
        )


def _check_range(name: str, value: int, lowest: int, highest: int) -> None:
    if not lowest <= value <= highest:
        raise ConfigError(f"{name} is {value}; expected {lowest} to {highest}")


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ConfigError(f'{name} is "{value}"; expected one of {", ".join(choices)}')
