"""How far a mean over queries may be trusted: percentile bootstrap intervals."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.metrics.checks import Float64Array

__all__ = ["Interval", "bootstrap_interval"]

BATCH_VALUES = 1 << 20
"""Values that are drawn at once."""
COUNTED_VALUES, COUNTED_RESAMPLES = 512, 2000
"""Up to so many values and resamples the draws are kept, at most 8 MB each, for the next run."""


@dataclass(frozen=True)
class Interval:
    """An interval with what is needed to draw it again; unpacks as ``low, high``."""

    low: float
    """Lower end."""
    high: float
    """Upper end."""
    level: float
    """Share of the resamples' means inside, such as 0.95."""
    n_resamples: int
    """How often the queries were drawn anew."""
    block_length: int
    """Neighbouring queries that were drawn together."""
    seed: int
    """Seed of the draws."""

    def __iter__(self) -> Iterator[float]:
        return iter((self.low, self.high))

    def to_dict(self) -> dict[str, float | int]:
        """Return the fields by name."""
        return asdict(self)


def bootstrap_interval(
    values: ArrayLike,
    *,
    level: float = 0.95,
    n_resamples: int = 2000,
    block_length: int = 1,
    seed: int = 0,
) -> Interval:
    """Return the percentile bootstrap interval of the mean of `values`.

    Parameters
    ----------
    values : bool or float array, shape (n,)
        One value per query, such as whether it was matched correctly.
    level : float in (0, 1)
        Share of the resamples inside the interval.
    n_resamples : int of at least 1
        How often n queries are drawn with replacement.
    block_length : int in [1, n]
        Runs of so many neighbours are drawn together, around the end of the traverse (circular
        block bootstrap). Neighbouring frames of a drive fail together, so 1 gives an interval that
        is too narrow for "another drive"; it only answers "other queries of this kind".
    seed : int
        Same seed, same interval.

    Returns
    -------
    Interval
        Its ends are the (1 - level) / 2 and (1 + level) / 2 quantiles of the resamples' means;
        NaN for no values.

    Raises
    ------
    ShapeError
        If `values` has not one axis.
    InputError
        If a value is NaN.
    ConfigError
        If a parameter is outside its range.

    References
    ----------
    Efron and Tibshirani, "An Introduction to the Bootstrap", 1993, section 13.3; Politis and
    Romano, "A circular block-resampling procedure for stationary data", 1992.
    """
    sample = np.asarray(values, np.float64)
    if sample.ndim != 1:
        raise ShapeError(f"values: got shape {sample.shape}, expected one axis")
    if np.isnan(sample).any():
        raise InputError("values: some are NaN; expected numbers")
    if not 0 < level < 1:
        raise ConfigError(f"level: got {level}, expected between 0 and 1")
    if n_resamples < 1:
        raise ConfigError(f"n_resamples: got {n_resamples}, expected at least 1")
    if not 1 <= block_length <= max(1, sample.size):
        raise ConfigError(f"block_length: got {block_length}, expected 1 to {sample.size}")
    if sample.size:
        means = _resampled_means(sample, n_resamples, block_length, seed)
        low, high = np.quantile(means, [(1 - level) / 2, (1 + level) / 2])
    else:
        low = high = float("nan")
    return Interval(float(low), float(high), level, n_resamples, block_length, seed)


def _resampled_means(
    sample: Float64Array, n_resamples: int, block_length: int, seed: int
) -> Float64Array:
    """Means of the resamples, shape (n_resamples,)."""
    if sample.size <= COUNTED_VALUES and n_resamples <= COUNTED_RESAMPLES:
        counts = _draw_counts(sample.size, n_resamples, block_length, seed)
        means: Float64Array = counts @ sample / sample.size
        return means
    draws = _draws(sample.size, n_resamples, block_length, seed)
    return np.concatenate([sample[index].mean(axis=1) for index in draws])


@lru_cache(maxsize=24)
def _draw_counts(n_values: int, n_resamples: int, block_length: int, seed: int) -> Float64Array:
    """How often each value is in each resample, (n_resamples, n_values).

    The draws do not depend on the values: a study asks for the same ones in every run of a drive.
    """
    counts = [
        _count_rows(index, n_values) for index in _draws(n_values, n_resamples, block_length, seed)
    ]
    return np.concatenate(counts)


def _count_rows(index: NDArray[np.int64], n_values: int) -> Float64Array:
    """How often each value is in each row of `index`: one count over all rows at once."""
    shifted = index + n_values * np.arange(len(index))[:, np.newaxis]
    counts = np.bincount(shifted.ravel(), minlength=len(index) * n_values)
    return counts.reshape(len(index), n_values).astype(np.float64)


def _draws(
    n_values: int, n_resamples: int, block_length: int, seed: int
) -> Iterator[NDArray[np.int64]]:
    """Yield which values are drawn, int (rows, n_values), in batches of bounded size."""
    random = np.random.default_rng(seed)
    n_blocks = -(-n_values // block_length)
    batch = max(1, BATCH_VALUES // n_values)
    for start in range(0, n_resamples, batch):
        n_rows = min(batch, n_resamples - start)
        first = random.integers(n_values, size=(n_rows, n_blocks, 1))
        index = (first + np.arange(block_length)).reshape(n_rows, -1) % n_values
        yield index[:, :n_values]
