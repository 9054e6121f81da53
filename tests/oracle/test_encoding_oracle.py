"""Encoding kernels against slow obvious loops and against scikit-image."""

import math
from typing import Any

import numpy as np
import pytest
from skimage.filters.rank import entropy
from skimage.morphology import disk

from retraverse.kernels import encoding, local_entropy, regional_hog
from retraverse.kernels.backend import native

SMOOTH = (1, 4, 6, 4, 1)
DERIVATIVE = (-1, -2, 0, 2, 1)


@pytest.fixture(params=["native", "numpy"], autouse=True)
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(encoding, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def inside(index: int, size: int) -> int:
    """Mirror an index at the border pixel, which is not repeated."""
    if index < 0:
        return -index
    return index if index < size else 2 * (size - 1) - index


def gradient(levels: list[list[float]], y: int, x: int) -> tuple[float, float]:
    size = len(levels)
    dx = dy = 0.0
    for j in range(5):
        for i in range(5):
            level = levels[inside(y + j - 2, size)][inside(x + i - 2, size)]
            dx += SMOOTH[j] * DERIVATIVE[i] * level
            dy += DERIVATIVE[j] * SMOOTH[i] * level
    return dx, dy


def slow_cell(
    levels: list[list[float]], top: int, left: int, cell: int, bins: int, signed: bool, mean: bool
) -> list[float]:
    histogram = [0.0] * bins
    for y in range(top, top + cell):
        for x in range(left, left + cell):
            dx, dy = gradient(levels, y, x)
            strength = abs(0.5 * dx + 0.5 * dy) if mean else math.sqrt(dx * dx + dy * dy)
            angle = math.degrees(math.atan2(dy, dx)) % (360 if signed else 180)
            place = angle / ((360 if signed else 180) / bins)
            lower, share = math.floor(place), place % 1
            histogram[lower % bins] += (1 - share) * strength
            histogram[(lower + 1) % bins] += share * strength
    return histogram


def slow_hog(grey: Any, cell: int, bins: int, signed: bool, mean: bool) -> Any:
    largest = int(grey.max())
    levels = [[math.sqrt(int(p) / largest) * 255 for p in row] for row in grey]
    rows = []
    for top in range(0, len(grey) - 2 * cell + 1, cell):
        for left in range(0, len(grey) - 2 * cell + 1, cell):
            block: list[float] = []
            for y, x in ((0, 0), (0, cell), (cell, 0), (cell, cell)):
                block += slow_cell(levels, top + y, left + x, cell, bins, signed, mean)
            norm = math.sqrt(sum(value * value for value in block))
            rows.append([value / norm for value in block])
    return np.array(rows)


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize("mean", [True, False])
@pytest.mark.parametrize(("size", "cell", "bins"), [(32, 16, 8), (24, 8, 9), (21, 7, 3)])
def test_regional_hog(size: int, cell: int, bins: int, signed: bool, mean: bool) -> None:
    seed = size + bins
    print("seed", seed)
    grey = np.random.default_rng(seed).integers(0, 240, (size, size), dtype=np.uint8)
    got = regional_hog(
        grey,
        cell=cell,
        bins=bins,
        orientation="signed" if signed else "unsigned",
        magnitude="mean" if mean else "euclidean",
    )
    np.testing.assert_allclose(got, slow_hog(grey, cell, bins, signed, mean), atol=1e-5)


@pytest.mark.parametrize("shape", [(100, 100), (23, 57), (4, 30), (30, 4), (3, 3)])
@pytest.mark.parametrize("radius", [1, 5, 8])
@pytest.mark.parametrize("levels", [2, 40, 256])
def test_local_entropy(shape: tuple[int, int], radius: int, levels: int) -> None:
    print("seed", radius)
    grey = np.random.default_rng(radius).integers(0, levels, shape, dtype=np.uint8)
    expected = entropy(grey, disk(radius))  # type: ignore[no-untyped-call]
    np.testing.assert_allclose(local_entropy(grey, radius=radius), expected, atol=1e-12)
