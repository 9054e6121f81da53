"""Regions, their vocabulary and VLAD: worked out by hand, and against slow loops."""

import numpy as np
import pytest

from retraverse.errors import InputError
from retraverse.techniques.summarising.regions import (
    build_clusters,
    nearest_cluster,
    region_features,
    vlad_of_regions,
)
from retraverse.types import FloatArray


def two_maps() -> FloatArray:
    """Return two maps: the first with a diagonal pair and a lone 9, the second with one 4."""
    maps = np.zeros((2, 4, 5), np.float32)
    maps[0, 0, 0], maps[0, 1, 1] = 2, 4
    maps[0, 3, 4] = 9
    maps[1, 1, 0] = 4
    return maps


def test_regions_by_hand() -> None:
    # Strengths: 9 alone; 4 alone; the pair's mean 3. Under the pair's box (rows 0-1, columns 0-1)
    # lie 6 of the first map and the second map's 4.
    assert region_features(two_maps(), 10).tolist() == [[9, 0], [0, 4], [6, 4]]


def test_only_the_strongest_are_kept() -> None:
    assert region_features(two_maps(), 2).tolist() == [[9, 0], [0, 4]]


def test_maps_without_values_have_no_regions() -> None:
    assert region_features(np.zeros((3, 4, 4), np.float32), 5).shape == (0, 3)


def test_regions_against_a_slow_search() -> None:
    random = np.random.default_rng(3)
    maps = np.maximum(random.standard_normal((4, 9, 9)) - 0.6, 0).astype(np.float32)
    expected = []
    for values in maps:
        left = {(int(y), int(x)) for y, x in zip(*np.nonzero(values), strict=True)}
        while left:
            region, front = set(), [left.pop()]
            while front:
                y, x = front.pop()
                region.add((y, x))
                near = {(y + j, x + i) for j in (-1, 0, 1) for i in (-1, 0, 1)} & left
                left -= near
                front += near
            rows, columns = zip(*region, strict=True)
            box = maps[:, min(rows) : max(rows) + 1, min(columns) : max(columns) + 1]
            strength = float(np.mean([values[place] for place in region]))
            expected.append((strength, box.sum(axis=(1, 2))))
    expected.sort(key=lambda one: -one[0])
    found = region_features(maps, 1000)
    np.testing.assert_allclose(found, [feature for _, feature in expected], rtol=1e-5)


def test_vlad_by_hand() -> None:
    centres = np.array([[0, 0], [10, 0]], np.float32)
    features = np.array([[1, 0], [2, 0], [10, 4], [6, 0]], np.float32)
    # Residuals: (1, 0) + (2, 0) at the first; (0, 4) + (-4, 0) at the second.
    roots = np.array([np.sqrt(3), 0, -2, 2])
    np.testing.assert_allclose(
        vlad_of_regions(features, centres), roots / np.linalg.norm(roots), rtol=1e-6
    )


def test_no_regions_are_no_descriptor() -> None:
    assert not vlad_of_regions(np.empty((0, 2), np.float32), np.ones((3, 2), np.float32)).any()


def test_nearest_cluster_is_the_nearest() -> None:
    random = np.random.default_rng(4)
    features, centres = random.standard_normal((50, 3)), random.standard_normal((7, 3))
    slow = [min(range(7), key=lambda k: float(((x - centres[k]) ** 2).sum())) for x in features]
    assert nearest_cluster(features, centres).tolist() == slow


def test_clusters_find_what_is_there() -> None:
    random = np.random.default_rng(5)
    places = np.array([[0, 0], [50, 0], [0, 50], [50, 50]], np.float32)
    features = (np.repeat(places, 30, axis=0) + random.standard_normal((120, 2))).astype(np.float32)
    found = build_clusters(features, 4, seed=1)
    order = np.lexsort((found[:, 0], found[:, 1]))
    np.testing.assert_allclose(found[order], features.reshape(4, 30, 2).mean(axis=1), rtol=1e-4,
                               atol=1e-4)  # fmt: skip


def test_the_seed_decides() -> None:
    features = np.random.default_rng(6).standard_normal((200, 4)).astype(np.float32)
    np.testing.assert_array_equal(build_clusters(features, 9), build_clusters(features, 9))
    assert (build_clusters(features, 9) != build_clusters(features, 9, seed=1)).any()


@pytest.mark.parametrize("n_different", [0, 1, 3])
def test_too_few_features_are_said(n_different: int) -> None:
    rows = np.repeat(np.arange(n_different), 3)[:, np.newaxis] * np.ones(2)
    with pytest.raises(InputError, match=f"{n_different} different features in all, expected at"):
        build_clusters(rows.astype(np.float32), 4)
