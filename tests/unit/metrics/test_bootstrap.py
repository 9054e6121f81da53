import math

import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.metrics import bootstrap_interval


def test_same_seed_same_interval_and_the_seed_is_recorded() -> None:
    values = np.arange(50) % 3 == 0
    first, again = (bootstrap_interval(values, seed=7) for _ in range(2))
    assert first == again
    assert first.seed == 7
    assert first.to_dict()["n_resamples"] == 2000
    means = np.linspace(0, 1, 50)
    assert bootstrap_interval(means, seed=8).low != bootstrap_interval(means, seed=7).low


def test_interval_holds_the_mean_and_widens_with_its_level() -> None:
    values = np.arange(60) % 4 == 0
    narrow, wide = (bootstrap_interval(values, level=level) for level in (0.5, 0.99))
    assert tuple(wide) == (wide.low, wide.high)
    assert wide.low < narrow.low < 0.25 < narrow.high < wide.high


@pytest.mark.parametrize("value", [True, False])
def test_values_that_never_vary_leave_no_doubt(value: bool) -> None:
    interval = bootstrap_interval(np.full(9, value))
    assert interval.low == interval.high == float(value)


def test_blocks_widen_the_interval_of_a_traverse_that_fails_in_runs() -> None:
    runs = np.repeat([True, False, True, True, False], 20)
    alone = bootstrap_interval(runs)
    together = bootstrap_interval(runs, block_length=20)
    assert together.high - together.low > 2 * (alone.high - alone.low)


def test_a_block_as_long_as_the_sample_only_rotates_it() -> None:
    interval = bootstrap_interval([0.0, 1.0, 5.0], block_length=3)
    assert interval.low == interval.high == 2.0


def test_batches_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("retraverse.metrics.bootstrap.BATCH_VALUES", 100)
    values = np.arange(30) % 2 == 0
    interval = bootstrap_interval(values, n_resamples=1000)
    assert 0.25 < interval.low < 0.5 < interval.high < 0.75


def test_no_values_no_interval() -> None:
    interval = bootstrap_interval([])
    assert math.isnan(interval.low)
    assert math.isnan(interval.high)


@pytest.mark.parametrize(
    ("values", "options", "error", "words"),
    [
        ([[1.0]], {}, ShapeError, "one axis"),
        ([1.0, math.nan], {}, InputError, "NaN"),
        ([1.0], {"level": 95}, ConfigError, "level: got 95"),
        ([1.0], {"n_resamples": 0}, ConfigError, "n_resamples: got 0"),
        ([1.0], {"block_length": 2}, ConfigError, "block_length: got 2, expected 1 to 1"),
    ],
)
def test_bad_input(
    values: list[float], options: dict[str, int], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        bootstrap_interval(values, **options)
