"""What a sequence length costs: from one matrix, for any K, for all K, and against plain loops.

200 x 200 frames of 512 values. The loops are algorithms 4 and 5 as they are written: for every
query window, every reference window and every pair, one cosine. They are timed in full.

    pytest benchmarks/test_sequences.py
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest

from retraverse.kernels import DiagonalSums, best_diagonals

FRAMES, VALUES, K = 200, 512, 20


def descriptors(seed: int) -> Any:
    return np.random.default_rng(seed).random((FRAMES, VALUES), dtype=np.float32)


@pytest.fixture(scope="module")
def similarity() -> Any:
    return cosines(descriptors(1), descriptors(2))


def cosines(query: Any, reference: Any) -> Any:
    """All cosines of two sets of descriptors, rows queries."""
    query = query / np.linalg.norm(query, axis=1, keepdims=True)
    reference = reference / np.linalg.norm(reference, axis=1, keepdims=True)
    return query @ reference.T


def cosine(a: Any, b: Any) -> float:
    return float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))


def loops(query: Any, reference: Any, length: int) -> tuple[list[int], list[float]]:
    """Algorithms 4 and 5, pair by pair."""
    best, scores = [], []
    for i in range(len(query) - length + 1):
        window = [
            sum(cosine(query[i + t], reference[j + t]) for t in range(length)) / length
            for j in range(len(reference) - length + 1)
        ]
        best.append(int(np.argmax(window)))
        scores.append(max(window))
    return best, scores


def fastest(functions: Sequence[Callable[[], Any]], rounds: int) -> list[float]:
    """Seconds of each function's fastest call, taken in turn."""
    times = [float("inf")] * len(functions)
    for _ in range(rounds):
        for index, function in enumerate(functions):
            start = time.perf_counter()
            function()
            times[index] = min(times[index], time.perf_counter() - start)
    return times


def test_against_algorithms_4_and_5_as_written(benchmark: Any) -> None:
    query, reference = descriptors(1), descriptors(2)

    def ours() -> Any:
        return best_diagonals(cosines(query, reference), K)

    start = time.perf_counter()
    best, scores = loops(query, reference, K)
    seconds = time.perf_counter() - start
    ratio = seconds / fastest([ours], 50)[0]
    assert ours().reference.tolist() == best
    np.testing.assert_allclose(ours().score, scores, atol=1e-5)
    benchmark.extra_info["times_faster"] = round(ratio)
    benchmark.extra_info["loops_s"] = round(seconds, 2)
    benchmark(ours)
    assert ratio > 500


def test_one_length_costs_the_same_whatever_k(benchmark: Any, similarity: Any) -> None:
    """No K is dearer than K = 1 by more than 1.3; near K = Q there are few windows left to rank."""
    lengths = [1, 2, 3, 5, 10, 20, 30, 50, 100, 150, FRAMES]
    functions = [partial(best_diagonals, similarity, K) for K in lengths]
    times = fastest(functions, 300)
    relative = {K: round(t / times[0], 2) for K, t in zip(lengths, times, strict=True)}
    benchmark.extra_info["cost_relative_to_k_1"] = relative
    benchmark(lambda: best_diagonals(similarity, K))
    assert max(relative.values()) <= 1.3


def test_all_lengths_cost_at_most_half_as_many_single_ones(benchmark: Any, similarity: Any) -> None:
    def every_length() -> None:
        sums = DiagonalSums(similarity)
        for length in range(1, FRAMES + 1):
            sums.best(length)

    single, every = fastest([lambda: best_diagonals(similarity, 1), every_length], 40)
    benchmark.extra_info["single_lengths"] = round(every / single, 1)
    benchmark(every_length)
    assert every / single <= FRAMES / 2


@pytest.mark.parametrize("size", [2000])
def test_large_matrix(benchmark: Any, size: int) -> None:
    similarity = np.random.default_rng(3).random((size, size), dtype=np.float32)
    benchmark.pedantic(best_diagonals, (similarity, K), rounds=5)
