"""Pooling: how the feature maps of a network become one vector a picture. NumPy only.

Feature maps are float32 (N, C, H, W), as PyTorch and ONNX have them; vectors are (N, D).
Nothing here normalises: `unit_rows` does.
"""

from typing import Any

import numpy as np

from retraverse.errors import ConfigError, ShapeError
from retraverse.types import FloatArray

__all__ = ["flat", "global_average", "global_gem", "grid", "pool", "pooled_length", "unit_rows"]

GRIDS = {"grid2": 2, "grid4": 4}
"""Names of the grids that `pool` knows, and their cells a side."""


def flat(features: FloatArray) -> FloatArray:
    """Return the maps row by row, (N, C * H * W): every position keeps its place."""
    return features.reshape(len(features), -1)


def global_average(features: FloatArray) -> FloatArray:
    """Return the mean of every map, (N, C): where something was seen is forgotten."""
    _check_maps(features)
    return np.asarray(features.mean(axis=(2, 3)), dtype=np.float32)


def global_gem(features: FloatArray, power: float = 3.0, least: float = 1e-6) -> FloatArray:
    """Return the generalised mean of every map, (N, C): between the mean and the maximum.

    Parameters
    ----------
    features : float32 array, shape (N, C, H, W)
        Values below `least` count as `least`.
    power : float > 0
        1 is the mean, infinity the maximum.
    least : float > 0

    References
    ----------
    Radenović, Tolias, Chum: Fine-tuning CNN Image Retrieval with No Human Annotation,
    TPAMI 2019, equation 3.
    """
    _check_maps(features)
    positive = np.maximum(features, least)
    largest = positive.max(axis=(2, 3), keepdims=True)  # factored out: no power overflows
    mean = ((positive / largest) ** power).mean(axis=(2, 3))
    return np.asarray(largest[:, :, 0, 0] * mean ** (1 / power), dtype=np.float32)


def grid(features: FloatArray, cells: int, how: str = "max") -> FloatArray:
    """Return the maximum or mean of every map in cells x cells parts, (N, C * cells**2).

    Parameters
    ----------
    features : float32 array, shape (N, C, H, W)
        H and W at least `cells`. Parts differ by at most one row or column, and where a side is
        no multiple of `cells` neighbours share it, as in adaptive pooling.
    cells : int
        Parts a side.
    how : {"max", "mean"}
    """
    _check_maps(features)
    reduce: Any = {"max": np.max, "mean": np.mean}[how]
    height, width = features.shape[2:]
    if min(height, width) < cells:
        raise ConfigError(f"pooling: got maps of {width} x {height}, expected at least {cells}")
    parts = [
        reduce(features[:, :, rows, columns], axis=(2, 3))
        for rows in _parts(height, cells)
        for columns in _parts(width, cells)
    ]
    return np.asarray(np.stack(parts, axis=2).reshape(len(features), -1), dtype=np.float32)


def pool(features: FloatArray, how: str) -> FloatArray:
    """Return the vectors of a pooling by name.

    Parameters
    ----------
    features : float32 array, shape (N, C, H, W)
    how : {"flat", "mean", "gem", "grid2_max", "grid2_mean", "grid4_max", "grid4_mean"}
    """
    simple = {"flat": flat, "mean": global_average, "gem": global_gem}
    if how in simple:
        return simple[how](features)
    name, _, reduction = how.partition("_")
    if name not in GRIDS or reduction not in ("max", "mean"):
        raise ConfigError(f"pooling: got {how!r}, expected flat, mean, gem or grid2_max and kin")
    return grid(features, GRIDS[name], reduction)


def pooled_length(shape: tuple[int, int, int], how: str) -> int:
    """Return how many values `pool` gives for maps of shape (C, H, W)."""
    return int(pool(np.zeros((1, *shape), np.float32), how).shape[1])


def unit_rows(vectors: FloatArray) -> FloatArray:
    """Return every row divided by its length, float32; a row of zeros stays zeros."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1), dtype=np.float32)


def _parts(size: int, cells: int) -> list[slice]:
    """Return the slices of one axis: part i reaches from floor(i s / n) to ceil((i + 1) s / n)."""
    return [slice(i * size // cells, -(-(i + 1) * size // cells)) for i in range(cells)]


def _check_maps(features: FloatArray) -> None:
    if features.ndim != 4:
        raise ShapeError(f"feature maps: got shape {features.shape}, expected (N, C, H, W)")
