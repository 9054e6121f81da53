"""What each matcher costs, against the mean of the diagonal and against plain loops.

pytest benchmarks/test_matchers.py
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _ratios import interleaved_minimum

import retraverse as rt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.oracle.seqslam_loops import match_loops

K = 10
ANY_SPEED = [
    ("dtw", {}), ("dtw", {"scope": "global"}), ("hmm", {}), ("hmm", {"decode": "lag"}),
    ("hmm", {"decode": "viterbi"}), ("hmm", {"decode": "smooth"}), ("graph", {}),
    ("graph", {"decode": "whole"}),
]  # fmt: skip


def drive(n_queries: int, n_references: int) -> Any:
    random = np.random.default_rng(3)
    return random.random((n_queries, n_references), np.float32) + np.eye(
        n_queries, n_references, dtype=np.float32
    )


@pytest.mark.parametrize("size", [2000, 3576])
def test_any_speed_costs_at_most_twenty_means(benchmark: Any, size: int) -> None:
    scores = drive(size, size)

    def run(name: str, parameters: dict[str, Any]) -> Any:
        matcher = rt.matcher(name, **parameters)
        return lambda: rt.match_similarity(scores, sequence_length=K, matcher=matcher)

    candidates = {"mean": run("mean", {})}
    candidates |= {f"{name} {parameters}": run(name, parameters) for name, parameters in ANY_SPEED}
    times = interleaved_minimum(candidates, rounds=4)
    ratios = {name: round(seconds / times["mean"], 1) for name, seconds in times.items()}
    benchmark.extra_info["cost_in_means"] = ratios
    benchmark.extra_info["mean_ms"] = round(times["mean"] * 1e3, 1)
    benchmark.pedantic(candidates["mean"], rounds=3)
    assert max(ratios.values()) <= 20


def test_seqslam_is_fifty_times_faster_than_plain_loops(benchmark: Any) -> None:
    scores = drive(60, 400)
    start = time.perf_counter()
    expected = match_loops(-scores, K)
    loops = time.perf_counter() - start

    def ours() -> rt.Matches:
        return rt.match_similarity(scores, sequence_length=K, matcher="seqslam")

    assert ours().reference.tolist() == [reference for _, reference, _ in expected]
    seconds = interleaved_minimum({"ours": ours})["ours"]
    benchmark.extra_info["times_faster"] = round(loops / seconds)
    benchmark.extra_info["loops_s"] = round(loops, 2)
    benchmark(ours)
    assert loops / seconds >= 50


def test_seqslam_on_a_whole_line(benchmark: Any) -> None:
    """Contrast enhancement and search of 3576 x 3576 pairs in under 2 s on two cores."""
    scores = drive(3576, 3576)

    def ours() -> rt.Matches:
        return rt.match_similarity(scores, sequence_length=K, matcher="seqslam")

    seconds = interleaved_minimum({"ours": ours}, rounds=3)["ours"]
    benchmark.extra_info["seconds"] = round(seconds, 2)
    benchmark.pedantic(ours, rounds=1)
    assert seconds < 2


@pytest.mark.parametrize("name", [info.name for info in rt.matchers()])
def test_cost_grows_linearly_with_the_map(benchmark: Any, name: str) -> None:
    small, large = drive(300, 2000), drive(300, 8000)
    times = interleaved_minimum(
        {
            "small": lambda: rt.match_similarity(small, sequence_length=K, matcher=name),
            "large": lambda: rt.match_similarity(large, sequence_length=K, matcher=name),
        },
        rounds=6,
    )
    benchmark.extra_info["four_times_the_map_costs"] = round(times["large"] / times["small"], 1)
    benchmark.pedantic(lambda: None, rounds=1)
    assert times["large"] < 6 * times["small"]
