"""How fast a frame is encoded: regional HOG and entropies at 512 x 512.

Both sides start from the same decoded grey picture, run on one thread in one process and take
turns; the ratio is that of the fastest rounds. The plain version writes the same lines with NumPy,
OpenCV and scikit-image as a careful author would, without loops over pixels.

    pytest benchmarks/test_encoding.py
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from skimage.filters.rank import entropy
from skimage.morphology import disk

from retraverse.kernels import local_entropy, region_entropies, regional_hog
from retraverse.kernels.backend import native

CELL, BINS, SIDE = 16, 8, 32


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(before)


@pytest.fixture(scope="module")
def grey() -> Any:
    """A picture with edges at every scale and some noise, 640 x 480 before resizing."""
    rng = np.random.default_rng(1)
    layers = [
        cv2.resize(rng.uniform(0, 255, (n * 3, n * 4)), (640, 480), interpolation=cv2.INTER_CUBIC)
        for n in (2, 8, 32, 160)
    ]
    return np.clip(np.mean(layers, axis=0) * 1.6 - 70, 0, 255).astype(np.uint8)


def plain_hog(grey: Any) -> Any:
    levels = np.sqrt(grey / grey.max()) * 255
    dx = cv2.Sobel(levels, cv2.CV_64F, 1, 0, ksize=5)
    dy = cv2.Sobel(levels, cv2.CV_64F, 0, 1, ksize=5)
    magnitude = np.abs(0.5 * dx + 0.5 * dy)
    place = cv2.phase(dx, dy, angleInDegrees=True) / (360 / BINS)
    lower = place.astype(np.intp)
    share = place - lower
    cell = np.arange(SIDE * CELL) // CELL
    first = (cell[:, None] * SIDE + cell) * BINS
    n_bins = SIDE * SIDE * BINS
    votes = np.bincount((first + lower % BINS).ravel(), (magnitude * (1 - share)).ravel(), n_bins)
    votes += np.bincount((first + (lower + 1) % BINS).ravel(), (magnitude * share).ravel(), n_bins)
    cells = votes.reshape(SIDE, SIDE, BINS)
    corners = (cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:])
    blocks = np.concatenate(corners, axis=2).reshape(-1, 4 * BINS)
    norm = np.linalg.norm(blocks, axis=1, keepdims=True)
    return (blocks / np.where(norm > 0, norm, 1)).astype(np.float32)


def plain_local_entropy(grey: Any) -> Any:
    return entropy(grey, disk(5))  # type: ignore[no-untyped-call]


def plain_entropies(grey: Any) -> tuple[Any, float]:
    small = plain_local_entropy(cv2.resize(grey, (100, 100)))
    large = cv2.resize(small, (SIDE * CELL, SIDE * CELL))
    cells = large.reshape(SIDE, CELL, SIDE, CELL).mean(axis=(1, 3))
    windows = (cells[:-1, :-1] + cells[:-1, 1:] + cells[1:, :-1] + cells[1:, 1:]) / 4
    return windows.ravel() / 8, large.mean() / 8


def plain_encode(grey: Any) -> tuple[Any, Any, float]:
    resized = cv2.resize(grey, (SIDE * CELL, SIDE * CELL))
    return plain_hog(resized), *plain_entropies(resized)


def encode(grey: Any) -> tuple[Any, Any, float]:
    resized = cv2.resize(grey, (SIDE * CELL, SIDE * CELL))
    entropies = region_entropies(local_entropy(cv2.resize(resized, (100, 100))))
    return regional_hog(resized), *entropies


def times_faster(ours: Callable[[], Any], theirs: Callable[[], Any], rounds: int = 30) -> float:
    """Ratio of the fastest of `rounds` calls each, taken in turn."""
    fastest = {ours: float("inf"), theirs: float("inf")}
    for _ in range(rounds):
        for function in fastest:
            start = time.perf_counter()
            function()
            fastest[function] = min(fastest[function], time.perf_counter() - start)
    return fastest[theirs] / fastest[ours]


def compare(benchmark: Any, ours: Callable[[], Any], theirs: Callable[[], Any]) -> float:
    ratio = times_faster(ours, theirs)
    benchmark.extra_info["times_faster"] = round(ratio, 1)
    benchmark(ours)
    return ratio


def test_both_sides_compute_the_same(grey: Any) -> None:
    for ours, theirs in zip(encode(grey), plain_encode(grey), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-3)


needs_native = pytest.mark.skipif(native() is None, reason="no compiled kernels here")


@needs_native
def test_encode_a_frame(benchmark: Any, grey: Any) -> None:
    assert compare(benchmark, lambda: encode(grey), lambda: plain_encode(grey)) > 10


@needs_native
def test_regional_hog(benchmark: Any, grey: Any) -> None:
    resized = cv2.resize(grey, (512, 512))
    compare(benchmark, lambda: regional_hog(resized), lambda: plain_hog(resized))


@needs_native
def test_entropies(benchmark: Any, grey: Any) -> None:
    small: Any = cv2.resize(grey, (100, 100))

    def ours() -> Any:
        return region_entropies(local_entropy(small))

    def theirs() -> Any:
        return cv2.resize(plain_local_entropy(small), (512, 512))

    compare(benchmark, ours, theirs)


@needs_native
@pytest.mark.parametrize("instruction_set", ["avx512", "avx2", "plain"])
def test_regional_hog_on_each_instruction_set(
    benchmark: Any, grey: Any, instruction_set: str
) -> None:
    compiled: Any = native()
    if instruction_set not in compiled.encoding_instruction_sets():
        pytest.skip(f"this processor has no {instruction_set}")
    resized = np.ascontiguousarray(cv2.resize(grey, (512, 512)))
    out = np.zeros((961, 32), np.float32)

    def ours() -> None:
        compiled.regional_hog(resized, out, CELL, BINS, True, False, instruction_set)

    compare(benchmark, ours, lambda: plain_hog(resized))


@pytest.mark.parametrize("size", [100, 512])
def test_local_entropy(benchmark: Any, grey: Any, size: int) -> None:
    small: Any = cv2.resize(grey, (size, size))
    compare(benchmark, lambda: local_entropy(small), lambda: plain_local_entropy(small))
