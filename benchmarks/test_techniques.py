"""How fast the techniques of chapter 7 and SeqSLAM's thumbnails are: ratios inside one run.

- GIST against its definition written plainly with NumPy's Fourier transforms, filters ready made;
  the times the thesis names are shown beside it.
- ORB matching of one query with 100 references of 500 keypoints against OpenCV's brute-force
  matcher with cross-check, and against the thesis' 111 ms at 256 px.
- The difference matrix of a whole line, 3576 x 3576 thumbnails of 64 x 32, against NumPy.

    pytest benchmarks/test_techniques.py -s
"""

import os
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import pytest
import threadpoolctl
from _ratios import interleaved_minimum

import retraverse as rt
from retraverse.kernels import instruction_sets, keypoint_matches, thumbnail_differences

SCALE = float(os.environ.get("RETRAVERSE_SCALE", "1"))
THESIS_GIST_MS = {16: 0.967, 32: 2, 64: 9.807, 128: 27.561, 256: 153.99, 512: 708.02, 1024: 4618.1}
THESIS_ORB_MS = 110.7


@pytest.fixture(params=[1, 2], ids=["1 thread", "2 threads"])
def threads(request: pytest.FixtureRequest) -> Iterator[int]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(request.param)
    with threadpoolctl.threadpool_limits(request.param, user_api="blas"):
        yield request.param
    cv2.setNumThreads(before)


def photograph(size: int) -> Any:
    """A picture with edges and texture at every scale."""
    random = np.random.default_rng(1)
    layers = [
        cv2.resize(random.uniform(0, 255, (n, n)), (size, size), interpolation=cv2.INTER_NEAREST)
        for n in (4, 8, 32, size)
    ]
    return np.clip(np.mean(layers, axis=0) * 1.6 - 70, 0, 255).astype(np.uint8)


class PlainGist:
    """The definition as one writes it down first: every transform in full, in float64."""

    def __init__(self, size: int) -> None:
        self.size, n = size, size + 64
        fy, fx = np.meshgrid(*[np.fft.fftfreq(n)] * 2, indexing="ij")
        radius, direction = np.hypot(fy, fx), np.arctan2(fy, fx)
        self.filters = []
        for centre in 0.3 / 1.85 ** np.arange(4):
            for angle in np.pi / 8 * np.arange(8):
                turned = (direction + angle + np.pi) % (2 * np.pi) - np.pi
                gain = np.exp(-3.5 * (radius / centre - 1) ** 2 - 2 * np.pi * turned**2)
                self.filters.append(gain)
        k = np.fft.fftfreq(size + 10) * (size + 10)
        self.low = np.exp(-np.add.outer(k**2, k**2) * np.log(2) / 16)

    def low_pass(self, picture: Any) -> Any:
        return np.fft.ifft2(np.fft.fft2(picture) * self.low).real

    def __call__(self, grey: Any) -> Any:
        levels = (grey - grey.min()) * (255 / float(np.ptp(grey)))
        logs = np.pad(np.log(1 + levels), 5, mode="symmetric")
        detail = logs - self.low_pass(logs)
        normal = detail / (0.2 + np.sqrt(np.abs(self.low_pass(detail**2))))
        spectrum = np.fft.fft2(np.pad(normal[5:-5, 5:-5], 32, mode="symmetric"))
        values = []
        for gain in self.filters:
            strength = np.abs(np.fft.ifft2(spectrum * gain))[32:-32, 32:-32]
            blocks = strength.reshape(4, self.size // 4, 4, self.size // 4)
            values.append(blocks.mean(axis=(1, 3)).ravel())
        descriptor = np.concatenate(values)
        return descriptor / np.linalg.norm(descriptor)


@pytest.mark.parametrize("size", [16, 32, 64, 128, 256, 512, 1024])
def test_gist_against_its_definition(benchmark: Any, size: int) -> None:
    picture, plain = photograph(size), PlainGist(size)
    cropped, full = (
        rt.technique("gist", resolution=size, transforms=how) for how in ("cropped", "full")
    )
    calls: dict[str, Callable[[], Any]] = {
        "cropped": lambda: cropped.describe(picture)["descriptor"],
        "full": lambda: full.describe(picture)["descriptor"],
        "plain": lambda: plain(picture),
    }
    apart = {name: np.abs(call() - plain(picture)).max() for name, call in calls.items()}
    assert apart["cropped"] < 1e-3
    assert apart["full"] < 1e-5
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    with threadpoolctl.threadpool_limits(1, user_api="blas"):
        rounds = 2 if size == 1024 else 6
        seconds = interleaved_minimum(calls, rounds=rounds, least_seconds=2 * SCALE)
    cv2.setNumThreads(before)
    info = benchmark.extra_info
    info["size"] = size
    for name in calls:
        info[f"{name}: ms"] = round(1e3 * seconds[name], 2)
    info["times faster than plain"] = round(seconds["plain"] / seconds["cropped"], 1)
    info["in full: times faster than plain"] = round(seconds["plain"] / seconds["full"], 1)
    info["thesis over ours"] = round(THESIS_GIST_MS[size] / (1e3 * seconds["cropped"]), 1)
    report(info, "GIST of one picture")
    benchmark.pedantic(calls["cropped"], rounds=3)
    if size in (256, 1024):
        assert info["thesis over ours"] > 8


def test_orb_matching(benchmark: Any, threads: int) -> None:
    random = np.random.default_rng(0)
    descriptors = random.integers(0, 256, (101, 500, 32)).astype(np.uint8)
    query, references = descriptors[:1], descriptors[1:]
    full = np.full(100, 500, np.int32)
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
    sets = [name for name in instruction_sets() if name in ("avx512", "avx2", "plain")]

    def ours(newest: str | None) -> Callable[[], Any]:
        return lambda: keypoint_matches(
            query, full[:1], references, full, threads=threads, instruction_set=newest
        )

    calls: dict[str, Callable[[], Any]] = {name: ours(name) for name in sets}
    calls["opencv"] = lambda: [len(matcher.match(query[0], each)) for each in references]
    assert ours(None)().tolist() == [calls["opencv"]()]
    seconds = interleaved_minimum(calls, rounds=5, least_seconds=3 * SCALE)
    info = benchmark.extra_info
    info["threads"] = threads
    for name in calls:
        info[f"{name}: ms for 100 references"] = round(1e3 * seconds[name], 1)
    for name in sets:
        info[f"{name}: times faster than OpenCV"] = round(seconds["opencv"] / seconds[name], 1)
    newest = min(seconds[name] for name in sets) if sets else seconds["opencv"]
    info["thesis over ours"] = round(THESIS_ORB_MS / (1e3 * newest), 1)
    report(info, "ORB matching, 500 keypoints a picture")
    benchmark.pedantic(ours(None), rounds=3)


@pytest.mark.parametrize("difference", ["absolute", "saturating"])
def test_difference_matrix_of_a_line(benchmark: Any, threads: int, difference: Any) -> None:
    n_frames, n_pixels = 3576, 64 * 32
    random = np.random.default_rng(0)
    queries, references = random.integers(0, 256, (2, n_frames, n_pixels)).astype(np.uint8)
    sets = [name for name in instruction_sets() if name in ("avx512", "avx2", "neon")]

    def ours(newest: str | None) -> Callable[[], Any]:
        return lambda: thumbnail_differences(
            queries, references, difference=difference, threads=threads, instruction_set=newest
        )

    def obvious(rows: int = 10) -> Any:
        wide = references.astype(np.int16)
        apart = (query.astype(np.int16) - wide for query in queries[:rows])
        change = np.abs if difference == "absolute" else lambda d: np.maximum(d, 0)
        return [change(each).sum(axis=1) for each in apart]

    calls: dict[str, Callable[[], Any]] = {name: ours(name) for name in sets}
    calls["numpy"] = obvious
    np.testing.assert_array_equal(ours(None)()[:10], obvious())
    seconds = interleaved_minimum(calls, rounds=3, least_seconds=2 * SCALE)
    seconds["numpy"] *= n_frames / 10
    pixels = n_frames**2 * n_pixels
    info = benchmark.extra_info
    info["threads"], info["difference"] = threads, difference
    for name in calls:
        info[f"{name}: s"] = round(seconds[name], 3)
        info[f"{name}: GB/s"] = round(pixels / seconds[name] / 1e9, 2)
    for name in sets:
        info[f"{name}: times faster than NumPy"] = round(seconds["numpy"] / seconds[name])
    report(info, "differences of 3576 x 3576 thumbnails")
    benchmark.pedantic(ours(None), rounds=2)


def report(info: dict[str, Any], title: str) -> None:
    print(f"\n{title}: " + ", ".join(f"{key} {value}" for key, value in info.items()))
