"""Regional matching against NumPy's matrix product, and the byte kernels against float32.

Every figure is a ratio of times taken in turns in one run. OPENBLAS_CORETYPE and OPENBLAS_L2_SIZE
slow NumPy down and with that flatter the kernels: unset both.
"""

import os
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import threadpoolctl
from _ratios import interleaved_minimum

from retraverse.kernels import instruction_sets, quantise_regions, regional_scores

G, N, L = 961, 961, 32
REFERENCES = 48
SIDE = 4096
PRODUCT_OPERATIONS = 2 * SIDE**3
SECONDS = 20 * float(os.environ.get("RETRAVERSE_SCALE", "1"))

Calls = dict[str, Callable[[], Any]]


@pytest.fixture(params=[1, 2], ids=["1 thread", "2 threads"])
def threads(request: pytest.FixtureRequest) -> Iterator[int]:
    with threadpoolctl.threadpool_limits(request.param, user_api="blas"):
        yield request.param


@pytest.fixture(scope="module")
def arrays() -> dict[str, Any]:
    rng = np.random.default_rng(0)
    query, references = rng.random((G, L)) ** 3, rng.random((REFERENCES, N, L)) ** 3
    query /= np.linalg.norm(query, axis=-1, keepdims=True)
    references /= np.linalg.norm(references, axis=-1, keepdims=True)
    return {
        "float32": (query.astype(np.float32), references.astype(np.float32)),
        "uint8": (quantise_regions(query), quantise_regions(references)),
        "weights": np.full((1, G), 1 / G, np.float32),
        "square": [rng.random((SIDE, SIDE), np.float32) for _ in range(3)],
    }


def kernel(arrays: dict[str, Any], precision: str, newest: str, threads: int) -> Callable[[], Any]:
    query, references = arrays[precision]
    return lambda: regional_scores(
        query, references, arrays["weights"], threads=threads, instruction_set=newest
    )


def obvious_pairs(query: Any, references: Any, weights: Any) -> Any:
    """Return the scores as one writes them first: a product and its row maxima, pair by pair."""
    return [weights @ np.dot(query, reference.T).max(axis=1) for reference in references]


def repeated(call: Callable[[], Any], times: int) -> Callable[[], Any]:
    def run() -> None:
        for _ in range(times):
            call()

    return run


def test_float32_against_matrix_product(benchmark: Any, arrays: Any, threads: int) -> None:
    # As many operations as the product has: a longer call is less likely to find a quiet moment.
    a, b, c = arrays["square"]
    operations = 2 * G * N * L * REFERENCES
    times = round(PRODUCT_OPERATIONS / operations)
    newest = kernel(arrays, "float32", instruction_sets()[0], threads)
    calls: Calls = {"product": lambda: np.matmul(a, b, out=c), "kernel": repeated(newest, times)}
    seconds = interleaved_minimum(calls, rounds=5, least_seconds=SECONDS)
    product_rate = PRODUCT_OPERATIONS / seconds["product"]
    kernel_rate = times * operations / seconds["kernel"]
    info = benchmark.extra_info
    info["threads"] = threads
    info["BLAS"] = [pool.get("architecture", "") for pool in threadpoolctl.threadpool_info()]
    info["product GFLOP/s"] = round(product_rate / 1e9, 1)
    info["kernel GFLOP/s"] = round(kernel_rate / 1e9, 1)
    info["ratio"] = round(kernel_rate / product_rate, 3)
    report(info, "float32 kernel's rate to a 4096 cubed product's")
    benchmark.pedantic(newest, rounds=5)


def test_float32_against_obvious_numpy(benchmark: Any, arrays: Any, threads: int) -> None:
    calls: Calls = {"numpy": lambda: obvious_pairs(*arrays["float32"], arrays["weights"])}
    sets = [name for name in instruction_sets() if name in ("avx512", "avx2", "neon", "plain")]
    calls |= {name: kernel(arrays, "float32", name, threads) for name in sets}
    seconds = interleaved_minimum(calls, rounds=5, least_seconds=SECONDS / 2)
    info = benchmark.extra_info
    info["threads"] = threads
    for name in calls:
        info[f"{name}: ms a pair"] = round(1e3 * seconds[name] / REFERENCES, 4)
    for name in sets:
        info[f"{name}: ratio"] = round(seconds["numpy"] / seconds[name], 2)
    report(info, "float32, times faster than dot and max per pair")
    benchmark.pedantic(calls[sets[0]], rounds=5)


def test_uint8_against_float32(benchmark: Any, arrays: Any, threads: int) -> None:
    newest = instruction_sets()[0]
    calls: Calls = {"float32": kernel(arrays, "float32", newest, threads)}
    byte_sets = [
        name for name in instruction_sets() if name in ("amx", "vnni", "avx2", "neondot", "plain")
    ]
    calls |= {name: kernel(arrays, "uint8", name, threads) for name in byte_sets}
    if "avx2" in byte_sets:
        calls["float32 avx2"] = kernel(arrays, "float32", "avx2", threads)
    seconds = interleaved_minimum(calls, rounds=5, least_seconds=SECONDS / 2)
    info = benchmark.extra_info
    info["threads"] = threads
    for name in byte_sets:
        info[f"{name}: ms a pair"] = round(1e3 * seconds[name] / REFERENCES, 4)
        info[f"{name}: ratio"] = round(seconds["float32"] / seconds[name], 2)
    if "avx2" in byte_sets:
        info["avx2: ratio to float32 on avx2"] = round(seconds["float32 avx2"] / seconds["avx2"], 2)
    report(info, "uint8")
    benchmark.pedantic(calls[byte_sets[0]], rounds=5)


def report(info: dict[str, Any], title: str) -> None:
    print(f"\n{title}: " + "; ".join(f"{name} = {value}" for name, value in info.items()))
