"""NumPy and OpenCV twins of the compiled encoding kernels.

They take the same arguments, write into the same output arrays and run where nothing
was compiled; arguments have been checked by `retraverse.kernels.encoding`.
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["local_entropy", "regional_hog"]

FIXED_POINT = 65536.0
"""Gamma levels are rounded to 1 / 65536 grey level; sums of them are then exact."""


def regional_hog(
    grey: ImageArray,
    descriptor: FloatArray,
    cell: int,
    bins: int,
    is_signed: bool,
    is_euclidean: bool,
) -> None:
    """Write the block descriptors of `grey`; see `retraverse.kernels.regional_hog`."""
    dx, dy = _gradients(_gamma(grey))
    magnitude = np.hypot(dx, dy) if is_euclidean else np.abs(dx + dy)
    turns = np.arctan2(dy, dx) / (2 * np.pi) % 1.0
    position = turns * bins if is_signed else turns * 2 % 1.0 * bins
    cells = _cell_histograms(magnitude, position, cell=cell, bins=bins)
    descriptor[:] = _normalised_blocks(cells)


def local_entropy(image: ImageArray, map: NDArray[np.float64], radius: int) -> None:
    """Write the disk entropy of every pixel; see `retraverse.kernels.local_entropy`."""
    offsets = _disk_offsets(radius)
    padded = np.full(np.add(image.shape, 2 * radius), 256, dtype=np.int64)  # 256 = outside
    padded[radius:-radius, radius:-radius] = image
    n_log2_n = _n_log2_n(len(offsets))
    width = image.shape[1]
    column = np.arange(width) * 257
    for y in range(image.shape[0]):
        rows = [column + padded[y + dy, dx : dx + width] for dy, dx in offsets]
        counts = np.bincount(np.concatenate(rows), minlength=257 * width)
        counts = counts.reshape(width, 257)[:, :256]
        n = counts.sum(axis=1)
        map[y] = (n_log2_n[n] - n_log2_n[counts].sum(axis=1)) / n


def _gamma(grey: ImageArray) -> NDArray[np.float64]:
    """Square-root gamma in units of 1 / 65536 grey level, whole numbers."""
    largest = max(int(grey.max()), 1)  # a black picture stays black
    levels = np.sqrt(np.arange(largest + 1) / largest) * 255.0 * FIXED_POINT
    return np.rint(levels)[grey]


def _gradients(levels: NDArray[np.float64]) -> tuple[Array, Array]:
    import cv2

    dx = cv2.Sobel(levels, cv2.CV_64F, 1, 0, ksize=5)
    dy = cv2.Sobel(levels, cv2.CV_64F, 0, 1, ksize=5)
    return dx, dy


def _cell_histograms(magnitude: Array, position: Array, *, cell: int, bins: int) -> Array:
    """Linear votes into the two nearest bins of each pixel's own cell: (cells, cells, bins)."""
    n_cells = magnitude.shape[0] // cell
    lower = np.floor(position).astype(np.int64)
    share = position - lower
    index = np.arange(magnitude.shape[0]) // cell
    first = (index[:, None] * n_cells + index) * bins
    votes = np.bincount((first + lower % bins).ravel(), ((1 - share) * magnitude).ravel())
    total = np.zeros(n_cells * n_cells * bins)
    total[: len(votes)] += votes
    votes = np.bincount((first + (lower + 1) % bins).ravel(), (share * magnitude).ravel())
    total[: len(votes)] += votes
    return total.reshape(n_cells, n_cells, bins)


def _normalised_blocks(cells: Array) -> Array:
    """2 x 2 cells side by side, each row of length 1 or 0: (blocks^2, 4 * bins)."""
    corners = (cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:])
    blocks = np.concatenate(corners, axis=2).reshape(-1, 4 * cells.shape[2])
    norm = np.linalg.norm(blocks, axis=1, keepdims=True)
    return blocks / np.where(norm > 0, norm, 1.0)


def _disk_offsets(radius: int) -> list[tuple[int, int]]:
    """(row, column) of the disk's pixels, counted from its bounding square's corner."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return [(int(a), int(b)) for a, b in np.argwhere(x * x + y * y <= radius * radius)]


def _n_log2_n(largest: int) -> NDArray[np.float64]:
    n = np.arange(largest + 1, dtype=np.float64)
    table: NDArray[np.float64] = n * np.log2(np.maximum(n, 1.0))
    return table
