"""How many pictures at once are fastest: measured, since more is often slower on a processor.

On two cores batches of 16 ran at 0.4 to 0.9 of the speed of one by one: what the layers pass on
no longer fits the cache. So one by one stays, unless a batch is clearly faster.
"""

from time import perf_counter
from typing import Protocol

import numpy as np

from retraverse.types import FloatArray

__all__ = ["Runner", "fastest_batch", "slices"]


class Runner(Protocol):
    """A network ready to run, whatever runs it. Thread-safe."""

    def __call__(self, pictures: FloatArray) -> FloatArray:
        """Return the network's output for float32 (N, C, H, W); its first axis is N."""
        ...


MOST_AT_ONCE = 16
GAIN = 0.9
"""A batch must take less than this share of the time one by one takes."""
SLOW_S = 0.25
"""Networks that take longer than this for a picture are not measured: nothing is to gain."""
_ROUNDS = 3


def fastest_batch(run: Runner, shape: tuple[int, ...]) -> int:
    """Return how many pictures in one run of a network are fastest: 1, 2, 4, 8 or 16.

    The batch is doubled as long as that takes clearly less time a picture, so that most networks
    are timed on some ten pictures of noise only.

    Parameters
    ----------
    run : Runner
        The network.
    shape : tuple of int
        Of one picture as the network takes it.
    """
    noise = np.random.default_rng(0).standard_normal((MOST_AT_ONCE, *shape), dtype=np.float32)
    started = perf_counter()
    run(noise[:1])
    if perf_counter() - started > SLOW_S:
        return 1
    size = 1
    while size < MOST_AT_ONCE and _gains(run, noise[: 2 * size], size):
        size *= 2
    return size


def slices(length: int, size: int) -> list[slice]:
    """Return consecutive slices of at most `size` that cover `length` items."""
    return [slice(start, start + size) for start in range(0, length, size)]


def _gains(run: Runner, pictures: FloatArray, size: int) -> bool:
    """Tell whether all pictures at once are clearly faster than in runs of `size`."""
    at_once, in_parts = float("inf"), float("inf")
    for _ in range(_ROUNDS):
        started = perf_counter()
        run(pictures)
        between = perf_counter()
        for part in slices(len(pictures), size):
            run(pictures[part])
        at_once = min(at_once, between - started)
        in_parts = min(in_parts, perf_counter() - between)
    return at_once < GAIN * in_parts
