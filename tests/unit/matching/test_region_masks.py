"""The map shows which regions tell no place: here, the robot's own bonnet."""

import numpy as np
import pytest
from tests.unit.matching.streets import described, street

import retraverse as rt
from retraverse.errors import ConfigError, InputError, MapError, ShapeError
from retraverse.matching import RegionMask, learn_region_mask, masked, masked_map
from retraverse.techniques import RegionalTechnique
from retraverse.types import ImageArray

# At 96 px there are 5 x 5 regions of 32 px, 16 px apart; those of the last row lie in the bonnet,
# so far in that no gradient reaches them from the street.
BONNET = np.arange(20, 25)


def with_bonnet(frames: list[ImageArray], seed: int) -> list[ImageArray]:
    """Return the frames with one and the same texture in their lowest 40 rows."""
    bonnet = np.random.default_rng(seed).integers(0, 256, (40, 96)).astype(np.uint8)
    return [np.concatenate([frame[:56], bonnet]) for frame in frames]


def route_of(frames: list[ImageArray], name: str = "cohog", **parameters: object) -> rt.RouteMap:
    technique = rt.technique(name, resolution=96, roi_entropy=0.0, **parameters)
    return rt.build_map(rt.open_traverse(frames), technique)


@pytest.fixture(scope="module")
def route() -> rt.RouteMap:
    return route_of(with_bonnet(street(40), seed=5))


def no_mask(n_regions: int = 25) -> RegionMask:
    return RegionMask(np.ones(n_regions, np.bool_), np.ones(n_regions, np.float32), 0.0)


@pytest.mark.parametrize("precision", ["float32", "int8"])
def test_the_bonnet_is_found(precision: str) -> None:
    route = route_of(with_bonnet(street(40), seed=5), precision=precision)
    mask = learn_region_mask(route, quantile=0.2)
    np.testing.assert_array_equal(np.flatnonzero(~mask.kept), BONNET)
    # Not quite 0: the brightest pixel of each frame scales all of its gradients a little.
    assert np.abs(mask.distinctiveness[BONNET]).max() < 1e-3
    assert mask.distinctiveness[mask.kept].min() > 5e-3


def test_distinctiveness_by_the_slow_way(route: rt.RouteMap) -> None:
    descriptors = route.descriptions().descriptor.astype(np.float64)
    rows = np.unique(np.linspace(0, 39, 32).round().astype(int))
    gains = np.zeros((len(rows), 25))
    for number, i in enumerate(rows):
        best = {j: (descriptors[i] @ descriptors[j].T).max(axis=1) for j in range(40)}
        near = np.mean([best[j] for j in (i - 1, i + 1) if 0 <= j < 40], axis=0)
        far = np.mean([best[j] for j in rows if abs(i - j) > 13], axis=0)
        gains[number] = near - far
    mask = learn_region_mask(route)
    np.testing.assert_allclose(mask.distinctiveness, gains.mean(axis=0), atol=1e-5)


def test_another_robots_bonnet_does_not_disturb(route: rt.RouteMap) -> None:
    query = rt.open_traverse(with_bonnet(street(40), seed=6))
    with_mask = masked_map(route, learn_region_mask(route, quantile=0.2))
    plain = np.diag(rt.similarity(query, route))
    without_bonnet = np.diag(rt.similarity(query, with_mask))
    assert (without_bonnet > plain).all()
    # What is left is of regions that reach into the bonnet from above.
    assert (1 - without_bonnet).mean() < 0.75 * (1 - plain).mean()


def test_nothing_masked_changes_nothing(route: rt.RouteMap) -> None:
    queries = described(with_bonnet(street(12, seed=2), seed=6), route.technique)
    unmasked = masked(route.technique, no_mask())
    np.testing.assert_allclose(
        unmasked.similarity(queries, route.descriptions()),
        route.technique.similarity(queries, route.descriptions()),
        atol=1e-6,
    )
    assert learn_region_mask(route, quantile=0).kept.all()


def test_weights_are_shared_among_the_regions_left(route: rt.RouteMap) -> None:
    mask = learn_region_mask(route, quantile=0.2)
    weights = masked(route.technique, mask).region_weights(route.descriptions(0, 3))
    assert weights.dtype == np.float32
    np.testing.assert_allclose(weights[:, mask.kept], 1 / 20)
    assert not weights[:, ~mask.kept].any()


def test_a_frame_whose_regions_are_all_masked_uses_them(route: rt.RouteMap) -> None:
    nothing = RegionMask(np.zeros(25, np.bool_), np.zeros(25, np.float32), 0.9)
    weights = masked(route.technique, nothing).region_weights(route.descriptions(0, 2))
    np.testing.assert_allclose(weights, 1 / 25)


def test_regions_outside_every_roi_are_kept() -> None:
    """The lower half is flat: never of interest, so nothing is known about it."""
    frames = [np.concatenate([f[:48], np.full((48, 96), 90, np.uint8)]) for f in street(30)]
    technique = rt.technique("cohog", resolution=96, roi_entropy=0.4)
    route = rt.build_map(rt.open_traverse(frames), technique)
    mask = learn_region_mask(route, quantile=0.5)
    unknown = np.isnan(mask.distinctiveness)
    assert unknown.any()
    assert mask.kept[unknown].all()
    known = mask.distinctiveness[~unknown]
    assert (~mask.kept).sum() == (known < np.quantile(known, 0.5)).sum() > 0


@pytest.mark.parametrize("length", [1, 4, "dynamic"])
@pytest.mark.parametrize("roi", ["first", "each"])
def test_masked_maps_can_be_matched(roi: str, length: int | str) -> None:
    frames = with_bonnet(street(30), seed=5)
    route = route_of(frames, "convsequential", roi=roi)
    with_mask = masked_map(route, learn_region_mask(route))
    assert isinstance(with_mask.technique, RegionalTechnique)
    query = rt.open_traverse(frames)
    matches = rt.match(query, with_mask, sequence_length=length)  # type: ignore[arg-type]
    np.testing.assert_array_equal(matches.reference, matches.query)


def test_bad_input(route: rt.RouteMap) -> None:
    hog = rt.build_map(rt.open_traverse(street(5)), rt.technique("hog", resolution=32))
    with pytest.raises(ConfigError, match="hog at these parameters has no regions"):
        learn_region_mask(hog)
    with pytest.raises(ConfigError, match="no regions"):
        masked(rt.technique("cohog", resolution=16), no_mask(0))
    with pytest.raises(InputError, match="at least 3"):
        learn_region_mask(route_of(street(2)))
    with pytest.raises(ShapeError, match="got one of 9 regions, expected 25"):
        masked(route.technique, no_mask(9))
    for quantile in (-0.1, 1.0, float("nan")):
        with pytest.raises(ConfigError, match="below 1"):
            learn_region_mask(route, quantile=quantile)


def test_a_map_takes_only_techniques_of_its_layout(route: rt.RouteMap) -> None:
    with pytest.raises(MapError, match="same layout"):
        route.with_technique(rt.technique("hog"))
    other = route.with_technique(route.technique)
    assert other.path is None
    assert len(other) == len(route)
    assert other.provenance.content_sha256 == route.provenance.content_sha256
