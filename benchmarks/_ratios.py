"""Times that can be divided by one another on a machine that others share."""

import time
from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["interleaved_minimum"]


def interleaved_minimum(
    candidates: Mapping[str, Callable[[], Any]],
    *,
    rounds: int = 20,
    least_seconds: float = 0.0,
) -> dict[str, float]:
    """Return each candidate's shortest time in seconds, after one call that is not timed.

    Candidates take turns, so that a slow minute of the machine meets all of them, and the shortest
    time is the one with the least of others' work in it. At least `rounds` turns are taken, and
    more until `least_seconds` have passed.
    """
    for call in candidates.values():
        call()
    best = dict.fromkeys(candidates, float("inf"))
    end = time.perf_counter() + least_seconds
    turn = 0
    while turn < rounds or time.perf_counter() < end:
        for name, call in candidates.items():
            start = time.perf_counter()
            call()
            best[name] = min(best[name], time.perf_counter() - start)
        turn += 1
    return best
