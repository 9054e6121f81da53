"""Regional HOG: regions of interest, their ceiling, sizes, and the 8-bit form."""

import logging

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.images import Frame
from retraverse.techniques import Descriptions, RegionalTechnique
from retraverse.techniques.handmade.regional_hog import MAX_ENTROPY
from retraverse.types import ImageArray


def describe(technique: RegionalTechnique, image: ImageArray) -> Descriptions:
    frame = Frame.from_array(image, name="picture", index=0)
    return Descriptions.stack([technique.describe(technique.read(frame))], technique.layout)


def regional(name: str = "cohog", **parameters: object) -> RegionalTechnique:
    technique = rt.technique(name, **parameters)
    assert isinstance(technique, RegionalTechnique)
    return technique


@pytest.mark.parametrize(
    ("resolution", "regions"), [(1024, 3969), (512, 961), (64, 9), (32, 1), (16, 0)]
)
def test_regions_at_each_size(resolution: int, regions: int) -> None:
    assert regional(resolution=resolution).layout.descriptor.shape == (regions, 32)


def test_half_textured_picture_is_matched_where_it_has_texture() -> None:
    picture = np.full((512, 512), 90, np.uint8)
    picture[:, 256:] = np.random.default_rng(0).integers(0, 256, (512, 256))
    technique = regional()
    weights = technique.region_weights(describe(technique, picture)).reshape(31, 31)
    assert (weights[:, :12] == 0).all()
    assert (weights[:, 18:] > 0).all()
    assert weights.sum() == pytest.approx(1, abs=1e-5)
    assert len(np.unique(weights)) == 2


def test_noise_comes_near_the_entropy_ceiling_but_not_over_it() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (100, 100)).astype(np.uint8)
    entropies = describe(regional(), picture).arrays["region_entropy"]
    assert 0.7 < entropies.max() <= MAX_ENTROPY == pytest.approx(0.7925, abs=1e-4)


@pytest.mark.parametrize("roi_entropy", [-0.1, 0.8, 1, float("nan")])
def test_impossible_thresholds_name_the_ceiling(roi_entropy: float) -> None:
    with pytest.raises(ConfigError, match=r"0\.7925"):
        rt.technique("cohog", roi_entropy=roi_entropy)


def test_no_region_of_interest_takes_all_and_warns_once(caplog: pytest.LogCaptureFixture) -> None:
    technique = regional(roi_entropy=0.79)
    flat = describe(technique, np.full((64, 64), 128, np.uint8))
    with caplog.at_level(logging.WARNING):
        weights = technique.region_weights(flat)
        technique.region_weights(flat)
    np.testing.assert_allclose(weights, 1 / 961, rtol=1e-5)
    assert [record.message for record in caplog.records] == [
        "cohog: 1 of 1 pictures have no region with entropy >= roi_entropy 0.79; all their "
        "regions are matched instead (dark or flat pictures? lower roi_entropy)"
    ]


@pytest.mark.parametrize(
    ("name", "parameters", "said"),
    [
        ("cohog", {"resolution": 100}, "multiple of 16"),
        ("cohog", {"resolution": 2048}, "16 to 1024"),
        ("cohog", {"orientation": "both"}, "'signed', 'unsigned'"),
        ("convsequential", {"max_sequence_length": 10}, "rising"),
        ("convsequential", {"min_sequence_length": 0}, "1 or more"),
        ("convsequential", {"information_threshold": 1.5}, "0 to 1"),
        ("convsequential", {"resolution": "big"}, "expected int"),
        ("convsequential", {"resolution": 512.5}, "whole number"),
        ("hog", {"resolution": 100}, "multiple of 8"),
        ("hog", {"form": "chapter6", "resolution": 16}, "at least 32"),
    ],
)
def test_parameters_out_of_range(name: str, parameters: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        rt.technique(name, **parameters)


@pytest.mark.parametrize(
    ("form", "resolution", "values"),
    [
        ("vprbench", 0, 35721), ("chapter6", 0, 8100), ("chapter7", 16, 9),
        ("chapter7", 64, 144), ("chapter7", 1024, 36864),
    ],
)  # fmt: skip
def test_published_sizes_of_hog(form: str, resolution: int, values: int) -> None:
    assert rt.technique("hog", form=form, resolution=resolution).layout.dimension == values


@pytest.mark.parametrize("option", ["orientation", "magnitude"])
def test_options_change_the_descriptor(option: str) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (64, 64)).astype(np.uint8)
    other = {"orientation": "unsigned", "magnitude": "euclidean"}[option]
    ours = describe(regional(resolution=64), picture).descriptor
    theirs = describe(regional(resolution=64, **{option: other}), picture).descriptor
    assert np.abs(ours - theirs).max() > 0.01


def test_a_gradient_turned_round_is_the_same_only_unsigned() -> None:
    ramp = np.tile(np.arange(64, dtype=np.uint8) * 3, (64, 1))
    for orientation, same in (("signed", False), ("unsigned", True)):
        technique = regional(resolution=64, orientation=orientation)
        up, down = describe(technique, ramp), describe(technique, ramp[:, ::-1].copy())
        alike = technique.similarity(up, down)[0, 0]
        assert (alike > 0.9) == same
