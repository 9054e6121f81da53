"""Dynamic windows of any technique: what the map teaches, and that scale does not matter."""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.unit.matching.streets import Rescaled, described, street

import retraverse as rt
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.matching import (
    GrowthRule,
    calibrate_growth,
    calibrated_windows,
    describe_entropy,
    describe_query,
    ensure_entropy,
    with_entropy,
)
from retraverse.matching.calibrated_length import Overlap
from retraverse.matching.windows import match_diagonals
from retraverse.techniques import Descriptions

HOG = {"form": "chapter6", "resolution": 96}


def hog_route(n_frames: int = 40) -> rt.RouteMap:
    return rt.build_map(rt.open_traverse(street(n_frames)), rt.technique("hog", **HOG))


def hog_queries(n_frames: int = 40, seed: int = 0) -> Descriptions:
    query = rt.open_traverse(street(n_frames, seed))
    return with_entropy(describe_query(query, hog_route()), describe_entropy(query))


@pytest.mark.parametrize(("n_frames", "far"), [(40, 13), (9, 3), (3, 1)])
def test_the_threshold_is_a_quantile_of_far_frames(n_frames: int, far: int) -> None:
    route = hog_route(n_frames)
    descriptors = route.descriptions().descriptor.astype(np.float64)
    similar = [
        float(descriptors[i] @ descriptors[j])
        for i in range(n_frames)
        for j in range(n_frames)
        if abs(i - j) > far
    ]
    for quantile in (0.0, 0.25, 0.5, 1.0):
        rule = calibrate_growth(route, quantile=quantile)
        expected = np.quantile(similar, quantile)
        assert rule.information_threshold == pytest.approx(expected, abs=1e-5)


def test_only_the_information_threshold_is_learned() -> None:
    base = GrowthRule(sequence_entropy=0.3, min_length=2, max_overlap_length=7, max_length=9)
    rule = calibrate_growth(hog_route(), base=base)
    assert rule.information_threshold != base.information_threshold
    assert (
        GrowthRule(
            sequence_entropy=0.3,
            information_threshold=rule.information_threshold,
            min_length=2,
            max_overlap_length=7,
            max_length=9,
        )
        == rule
    )


def test_a_long_map_costs_no_more_than_a_short_one(monkeypatch: pytest.MonkeyPatch) -> None:
    route = hog_route(300)
    compared: list[tuple[int, int]] = []
    similarity = route.technique.similarity

    def watch(queries: Descriptions, references: Descriptions) -> object:
        compared.append((len(queries), len(references)))
        return similarity(queries, references)

    monkeypatch.setattr(route.technique, "similarity", watch)
    calibrate_growth(route)
    assert sum(a * b for a, b in compared) <= 48 * 48


@pytest.mark.parametrize(("factor", "offset"), [(0.05, 0.9), (1.0, -3.0), (250.0, 0.0)])
def test_the_same_windows_whatever_the_scale_of_similarity(factor: float, offset: float) -> None:
    route, queries = hog_route(), hog_queries(seed=3)
    rescaled = route.with_technique(Rescaled(route.technique, factor, offset))  # type: ignore[arg-type]
    assert calibrated_windows(queries, rescaled) == calibrated_windows(queries, route)


def test_a_higher_quantile_makes_no_window_longer() -> None:
    route, queries = hog_route(), hog_queries(seed=3)
    lengths = []
    for quantile in (0.05, 0.25, 0.5, 0.75, 0.95):
        rule = calibrate_growth(route, quantile=quantile)
        windows = calibrated_windows(queries, route, rule=rule)
        lengths.append([window.length for window in windows])
    for longer, shorter in itertools.pairwise(lengths):
        # The last window ends with the drive, whichever it is.
        common = min(len(longer), len(shorter)) - 1
        assert all(a >= b for a, b in zip(longer[:common], shorter[:common], strict=True))
    assert np.mean(lengths[0]) > np.mean(lengths[-1])


def test_a_slow_drive_gets_longer_windows_than_a_fast_one() -> None:
    route = rt.build_map(rt.open_traverse(street(60, step=16)), rt.technique("hog", **HOG))
    rule = calibrate_growth(route)
    means = []
    for step in (2, 16, 96):
        query = rt.open_traverse(street(40, step=step))
        queries = with_entropy(describe_query(query, route), describe_entropy(query))
        windows = calibrated_windows(queries, route, rule=rule)
        means.append(np.mean([window.length for window in windows]))
    assert means[0] > means[1] > means[2]
    assert means[0] > 10


def test_dark_pictures_get_the_longest_windows() -> None:
    dark = [frame // 40 for frame in street(60)]
    route = hog_route()
    query = rt.open_traverse(dark)
    queries = with_entropy(describe_query(query, route), describe_entropy(query))
    assert queries.arrays["entropy"].max() < 0.5
    assert calibrated_windows(queries, route)[0].length == 25


def test_overlap_is_the_techniques_own_similarity() -> None:
    technique = rt.technique("cohog", resolution=96)
    queries = described(street(15), technique)
    overlap = Overlap(technique, queries)
    expected = technique.similarity(queries, queries)
    for first in (0, 3, 14, 2):
        for later in range(first + 1, 15):
            assert overlap(first, later) == pytest.approx(expected[first, later], abs=1e-6)


def test_techniques_that_store_entropy_use_theirs() -> None:
    technique = rt.technique("cohog", grey="decoder", resolution=512)
    frames = street(8)
    stored = described(frames, technique).arrays["entropy"]
    measured = describe_entropy(rt.open_traverse(frames))
    np.testing.assert_array_equal(stored, measured)
    np.testing.assert_array_equal(describe_entropy(rt.open_traverse(frames), threads=1), measured)


def test_entropy_is_measured_only_where_it_is_missing() -> None:
    query, route = rt.open_traverse(street(6)), hog_route()
    queries = describe_query(query, route)
    complete = ensure_entropy(queries, query)
    np.testing.assert_array_equal(complete.arrays["entropy"], describe_entropy(query))
    assert ensure_entropy(complete, query) is complete
    assert ensure_entropy(queries, queries) is queries


def test_bad_input() -> None:
    route = hog_route()
    with pytest.raises(ConfigError, match="with_entropy"):
        calibrated_windows(describe_query(rt.open_traverse(street(5)), route), route)
    with pytest.raises(ConfigError, match="0 to 1"):
        calibrate_growth(route, quantile=1.5)
    with pytest.raises(InputError, match="at least 3 frames"):
        calibrate_growth(hog_route(2))
    with pytest.raises(ShapeError, match="one per frame"):
        with_entropy(route.descriptions(), np.zeros(3))


def test_a_map_without_descriptors_teaches_nothing() -> None:
    black = rt.open_traverse([np.zeros((96, 96), np.uint8)] * 5)
    route = rt.build_map(black, rt.technique("hog", **HOG))
    with pytest.raises(InputError, match="0 of 5 looked at with a descriptor"):
        calibrate_growth(route)


@pytest.mark.parametrize(("name", "resolution"), [("hog", 512), ("cohog", 256)])
def test_real_drives_gain_over_single_frames(
    shared: Callable[[str], Path], name: str, resolution: int
) -> None:
    query = rt.open_traverse(shared("data/corridor/query"))
    reference = rt.open_traverse(shared("data/corridor/reference"))
    route = rt.build_map(reference, rt.technique(name, resolution=resolution))
    queries = with_entropy(describe_query(query, route), describe_entropy(query))
    lengths = np.array([window.length for window in calibrated_windows(queries, route)])
    scores = rt.similarity(queries, route)
    references, _ = match_diagonals([(0, scores)], lengths)
    truth = rt.ground_truth(shared("data/corridor/ground_truth.json"))
    dynamic = truth.is_correct(np.arange(len(lengths)), references).mean()
    single = rt.evaluate(rt.match_similarity(scores, sequence_length=1), truth).accuracy
    print(f"{name}: K {np.bincount(lengths)}, accuracy {dynamic:.3f}, single {single:.3f}")
    assert len(np.unique(lengths)) > 3
    assert dynamic > single + 0.1
