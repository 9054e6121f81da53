"""The regional kernels against the obvious loop, in float64 and without a matrix product."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from retraverse.errors import InputError
from retraverse.kernels import instruction_sets, quantise_regions, regional_scores

# Every instruction set of this machine, and the NumPy twin.
WAYS = [*instruction_sets(), "numpy"]


@contextmanager
def run_by(way: str) -> Iterator[dict[str, Any]]:
    """Select the twin or the compiled kernels; yields the keyword arguments."""
    with pytest.MonkeyPatch.context() as patch:
        if way == "numpy":
            patch.setenv("RETRAVERSE_KERNELS", "numpy")
            yield {}
        else:
            yield {"instruction_set": way}


def obvious_scores(query: Any, references: Any, weights: Any, unit: float = 1) -> Any:
    """Return the definition, term by term."""
    out = np.zeros((len(weights), len(references)))
    for r, reference in enumerate(references.astype(np.float64)):
        for g, region in enumerate(query.astype(np.float64)):
            best = max(float((region * other).sum()) for other in reference)
            out[:, r] += weights[:, g].astype(np.float64) * best / unit
    return out


def problem(seed: int, G: int, N: int, L: int, R: int = 2, M: int = 2) -> tuple[Any, Any, Any]:
    """Return regions like those of regional HOG, and weights of which about half are 0."""
    rng = np.random.default_rng(seed)
    query, references = rng.random((G, L)) ** 3, rng.random((R, N, L)) ** 3
    query /= np.linalg.norm(query, axis=-1, keepdims=True)
    references /= np.linalg.norm(references, axis=-1, keepdims=True)
    weights = rng.random((M, G)) * (rng.random(G) < 0.5) / G
    return query.astype(np.float32), references.astype(np.float32), weights.astype(np.float32)


shapes = {
    "seed": st.integers(0, 2**32 - 1),
    "G": st.integers(1, 150),
    "N": st.integers(1, 50),
    "L": st.one_of(st.just(32), st.integers(1, 150)),
}


@pytest.mark.parametrize("way", WAYS)
@settings(max_examples=40, deadline=None)
@given(**shapes)
@example(seed=0, G=1, N=1, L=1)
@example(seed=1, G=140, N=9, L=32)
@example(seed=2, G=33, N=49, L=36)
@example(seed=3, G=65, N=33, L=64)
@example(seed=4, G=17, N=32, L=65)
@example(seed=5, G=16, N=31, L=8)
@example(seed=6, G=49, N=1, L=128)
def test_agrees_with_the_obvious_loop(way: str, seed: int, G: int, N: int, L: int) -> None:
    query, references, weights = problem(seed, G, N, L)
    with run_by(way) as how:
        scores = regional_scores(query, references, weights, **how)
        np.testing.assert_allclose(
            scores, obvious_scores(query, references, weights), rtol=2e-5, atol=1e-6
        )
        query, references = quantise_regions(query), quantise_regions(references)
        scores = regional_scores(query, references, weights, **how)
    expected = obvious_scores(query, references, weights, unit=255**2)
    np.testing.assert_allclose(scores, expected, rtol=2e-6, atol=1e-7)


@pytest.mark.parametrize("way", WAYS)
def test_bytes_of_any_size(way: str) -> None:
    rng = np.random.default_rng(7)
    query = rng.integers(0, 256, (40, 32), np.uint8)
    references = rng.integers(0, 256, (3, 70, 32), np.uint8)
    references[1] = 255
    query[3], query[4] = 255, 0
    weights = np.eye(40, dtype=np.float32)
    with run_by(way) as how:
        scores = regional_scores(query, references, weights, **how)
    expected = (query.astype(int) @ references.astype(int).transpose(0, 2, 1)).max(axis=2).T
    np.testing.assert_allclose(scores * np.float32(255**2), expected, rtol=2e-7)


@pytest.mark.parametrize("way", WAYS)
def test_signed_values(way: str) -> None:
    rng = np.random.default_rng(8)
    query = rng.normal(size=(70, 32)).astype(np.float32)
    references = rng.normal(size=(2, 11, 32)).astype(np.float32) - 3
    weights = rng.normal(size=(3, 70)).astype(np.float32)
    with run_by(way) as how:
        scores = regional_scores(query, references, weights, **how)
    np.testing.assert_allclose(scores, obvious_scores(query, references, weights), atol=2e-3)


@pytest.mark.parametrize("quantise", [False, True], ids=["float32", "uint8"])
@pytest.mark.parametrize("way", WAYS)
class TestInvariances:
    @pytest.fixture
    def arrays(self, quantise: bool) -> tuple[Any, Any, Any]:
        query, references, weights = problem(11, G=300, N=225, L=32, R=23, M=3)
        if quantise:
            return quantise_regions(query), quantise_regions(references), weights
        return query, references, weights

    def test_threads(self, way: str, arrays: tuple[Any, Any, Any]) -> None:
        with run_by(way) as how:
            alone = regional_scores(*arrays, threads=1, **how)
            for threads in (2, 3, 5, 40):
                np.testing.assert_array_equal(
                    regional_scores(*arrays, threads=threads, **how), alone
                )

    def test_order_of_reference_regions(self, way: str, arrays: tuple[Any, Any, Any]) -> None:
        query, references, weights = arrays
        order = np.random.default_rng(12).permutation(references.shape[1])
        shuffled = np.ascontiguousarray(references[:, order])
        with run_by(way) as how:
            before = regional_scores(query, references, weights, **how)
            after = regional_scores(query, shuffled, weights, **how)
        # NumPy's product may round a column otherwise in another place.
        np.testing.assert_allclose(after, before, rtol=1e-6 if way == "numpy" else 0)

    def test_rows_without_weight(self, way: str, arrays: tuple[Any, Any, Any]) -> None:
        query, references, weights = arrays
        used = weights.any(axis=0)
        assert 0 < used.sum() < len(used)
        with run_by(way) as how:
            whole = regional_scores(query, references, weights, **how)
            compact = regional_scores(query[used], references, weights[:, used], **how)
        np.testing.assert_array_equal(whole, compact)

    def test_order_of_references(self, way: str, arrays: tuple[Any, Any, Any]) -> None:
        query, references, weights = arrays
        with run_by(way) as how:
            forward = regional_scores(query, references, weights, **how)
            reverse = np.ascontiguousarray(references[::-1])
            backward = regional_scores(query, reverse, weights, **how)
        tolerance = 1e-6 if way == "numpy" else 0
        np.testing.assert_allclose(backward[:, ::-1], forward, rtol=tolerance)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_every_place_is_looked_at(way: str, value: float) -> None:
    query, references, weights = problem(14, G=4, N=5, L=31)
    with run_by(way) as how:
        for place in range(references[1].size):
            spoilt = references.copy()
            spoilt[1].flat[place] = value
            with pytest.raises(InputError, match=r"references\[1\] holds"):
                regional_scores(query, spoilt, weights, **how)


FUSED = [name for name in WAYS if name in ("amx", "vnni", "avx512", "avx2", "neondot", "neon")]


@pytest.mark.skipif(len(FUSED) < 2, reason="this machine has fewer than two fused sets")
def test_sets_that_fuse_agree_bit_for_bit() -> None:
    arrays = problem(13, G=129, N=50, L=36)
    first, *others = [regional_scores(*arrays, instruction_set=name) for name in FUSED]
    for scores in others:
        np.testing.assert_array_equal(scores, first)


@pytest.mark.parametrize("way", WAYS)
def test_bytes_are_near_floats_on_real_descriptors(way: str, shared: Callable[[str], Path]) -> None:
    with np.load(shared("golden/cohog_descriptors_corridor_q0-2.npz")) as golden:
        frames = np.stack([golden[f"d{i}"] for i in range(3)]).astype(np.float32)
    weights = np.full((1, frames.shape[1]), 1 / frames.shape[1], np.float32)
    small = quantise_regions(frames)
    with run_by(way) as how:
        for frame, small_frame in zip(frames, small, strict=True):
            precise = regional_scores(frame, frames, weights, **how)
            coarse = regional_scores(small_frame, small, weights, **how)
            np.testing.assert_allclose(coarse, precise, atol=2e-3)
