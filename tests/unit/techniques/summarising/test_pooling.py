import numpy as np
import pytest
import torch
from torch.nn import functional

from retraverse.errors import ConfigError, ShapeError
from retraverse.techniques.summarising import pooling
from retraverse.types import FloatArray


@pytest.fixture(params=[(7, 7), (5, 9), (4, 14)], ids=str)
def features(request: pytest.FixtureRequest) -> FloatArray:
    return np.random.default_rng(1).standard_normal((3, 6, *request.param), dtype=np.float32)


@pytest.mark.parametrize("cells", [1, 2, 3, 4])
def test_grids_are_adaptive_pooling(features: FloatArray, cells: int) -> None:
    given = torch.from_numpy(features)
    for how, adaptive in (
        ("max", functional.adaptive_max_pool2d),
        ("mean", functional.adaptive_avg_pool2d),
    ):
        expected = adaptive(given, cells).reshape(3, -1).numpy()
        np.testing.assert_allclose(pooling.grid(features, cells, how), expected, atol=1e-6)


def test_gem_lies_between_mean_and_maximum(features: FloatArray) -> None:
    positive: FloatArray = (np.abs(features) + 0.1).astype(np.float32)
    np.testing.assert_allclose(
        pooling.global_gem(positive, 1.0), pooling.global_average(positive), rtol=1e-5
    )
    np.testing.assert_allclose(
        pooling.global_gem(positive, 200.0), positive.max(axis=(2, 3)), rtol=0.03
    )
    cubes = (positive.astype(np.float64) ** 3).mean(axis=(2, 3)) ** (1 / 3)
    np.testing.assert_allclose(pooling.global_gem(positive), cubes, rtol=1e-5)


@pytest.mark.parametrize("how", ["flat", "mean", "gem", "grid2_max", "grid4_mean"])
def test_names_and_lengths(features: FloatArray, how: str) -> None:
    pooled = pooling.pool(features, how)
    assert pooled.shape == (3, pooling.pooled_length(features.shape[1:], how))
    assert pooled.dtype == np.float32


@pytest.mark.parametrize("how", ["", "grid3_max", "grid2_sum", "Flat"])
def test_unknown_names(features: FloatArray, how: str) -> None:
    with pytest.raises(ConfigError, match="pooling: got"):
        pooling.pool(features, how)


def test_maps_smaller_than_the_grid() -> None:
    with pytest.raises(ConfigError, match="got maps of 3 x 4, expected at least 4"):
        pooling.grid(np.zeros((1, 2, 4, 3), np.float32), 4)


def test_vectors_are_no_maps() -> None:
    with pytest.raises(ShapeError, match=r"got shape \(2, 5\), expected \(N, C, H, W\)"):
        pooling.global_average(np.zeros((2, 5), np.float32))


def test_unit_rows_keep_zeros() -> None:
    rows = pooling.unit_rows(np.array([[3, 4], [0, 0]], np.float32))
    expected = np.array([[0.6, 0.8], [0, 0]])
    np.testing.assert_allclose(rows, expected, atol=1e-7)
