from collections.abc import Callable
from typing import Any

import pytest

from retraverse.techniques.running import batching
from retraverse.techniques.running.batching import MOST_AT_ONCE, fastest_batch, slices
from retraverse.types import FloatArray


class Machine:
    """A network on a clock of its own: so many seconds a run, by the pictures in it."""

    def __init__(self, seconds: Callable[[int], float]) -> None:
        self._seconds = seconds
        self.now = 0.0
        self.n_pictures = 0

    def __call__(self, pictures: FloatArray) -> FloatArray:
        self.n_pictures += len(pictures)
        self.now += self._seconds(len(pictures))
        return pictures


@pytest.mark.parametrize(
    ("seconds", "best", "most_pictures"),
    [
        (lambda n: 0.02, MOST_AT_ONCE, 300),  # a run costs the same whatever is in it
        (lambda n: 0.018 + 0.01 * n, 8, 300),  # 16 at once are 9 % faster than 8: not clearly
        (lambda n: 0.01 * n, 1, 13),  # a picture costs the same wherever it is
        (lambda n: 0.0095 * n + 0.0005, 1, 13),  # hardly a gain
        (lambda n: 0.01 * n**1.4, 1, 13),  # more at once are slower
        (lambda n: 0.26, 1, 1),  # so slow that nothing is tried
    ],
)
def test_the_largest_batch_that_is_clearly_faster(
    seconds: Callable[[int], float], best: int, most_pictures: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(seconds)
    monkeypatch.setattr(batching, "perf_counter", lambda: machine.now)
    assert fastest_batch(machine, (3, 2, 2)) == best
    assert machine.n_pictures <= most_pictures


@pytest.mark.parametrize(
    ("length", "size", "expected"),
    [(0, 3, []), (3, 3, [3]), (7, 3, [3, 3, 1]), (2, 16, [2])],
)
def test_slices_cover_all_once(length: int, size: int, expected: Any) -> None:
    items = list(range(length))
    parts = [items[part] for part in slices(length, size)]
    assert [len(part) for part in parts] == expected
    assert [item for part in parts for item in part] == items
