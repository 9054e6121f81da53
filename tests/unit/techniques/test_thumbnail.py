"""Thumbnails: normalised patches, differences, similarity and back, flat pictures, parameters."""

import statistics
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.images import Frame, open_traverse
from retraverse.techniques import Descriptions, Technique
from retraverse.techniques.thumbnail import patch_normalised


def noise(seed: int, height: int = 32, width: int = 64, low: int = 0, high: int = 256) -> Any:
    print("seed", seed)
    return np.random.default_rng(seed).integers(low, high, (height, width)).astype(np.uint8)


def describe(technique: Technique, *pictures: Any) -> Descriptions:
    return Descriptions.stack(map(technique.describe, pictures), technique.layout)


def by_hand(patch: list[int]) -> list[int]:
    """Return the normalised pixels of one patch: Python's own mean, deviation and rounding."""
    mean, deviation = statistics.fmean(patch), statistics.stdev(patch)
    distances = [(pixel - mean) / deviation for pixel in patch]
    return [127 + int(abs(d) + 0.5) * (1 if d > 0 else -1) for d in distances]


@pytest.mark.parametrize(("patch", "size"), [(8, 32), (2, 6), (3, 9), (4, 20)])
def test_every_patch_is_normalised_on_its_own(patch: int, size: int) -> None:
    grey = noise(patch, size, 2 * size)
    normalised = patch_normalised(grey, patch)
    assert normalised.dtype == np.uint8
    for y in range(0, size, patch):
        for x in range(0, 2 * size, patch):
            here = np.s_[y : y + patch, x : x + patch]
            assert normalised[here].ravel().tolist() == by_hand(grey[here].ravel().tolist())


def test_a_patch_without_contrast_is_127() -> None:
    grey = noise(1)
    grey[8:16, 16:24] = 200
    normalised = patch_normalised(grey)
    assert (normalised[8:16, 16:24] == 127).all()
    assert np.ptp(normalised[:8]) > 0


def test_brightness_and_contrast_of_a_patch_do_not_count() -> None:
    grey = noise(2, high=100)
    changed = grey.copy()
    changed[:8, :8] = changed[:8, :8] * 2 + 30
    changed[8:16] += 90
    np.testing.assert_array_equal(patch_normalised(grey), patch_normalised(changed))


@pytest.mark.parametrize(("name", "span"), [("sad", 255), ("patchnorm", 16)])
@pytest.mark.parametrize("difference", ["absolute", "saturating"])
def test_similarity_and_differences_follow_from_one_another(
    name: str, span: int, difference: str
) -> None:
    technique: Any = rt.technique(name, difference=difference)
    queries = describe(technique, *(noise(seed) for seed in range(4)))
    references = describe(technique, *(noise(seed) for seed in range(3, 8)))
    apart = queries.descriptor[:, np.newaxis].astype(np.int64) - references.descriptor
    expected = np.abs(apart) if difference == "absolute" else np.maximum(apart, 0)
    np.testing.assert_array_equal(technique.differences(queries, references), expected.sum(axis=2))
    similarity = technique.similarity(queries, references)
    assert similarity.dtype == np.float32
    np.testing.assert_allclose(similarity, 1 - expected.mean(axis=2) / span, atol=1e-6)
    back = np.rint((1 - similarity) * 2048 * span)
    np.testing.assert_array_equal(back, expected.sum(axis=2))


def test_opposite_patches_are_as_unlike_as_can_be() -> None:
    dot = np.zeros((32, 64), np.uint8)
    dot[3::8, 4::8] = 255
    technique = rt.technique("patchnorm")
    one_dot = describe(technique, dot).descriptor
    assert one_dot.max() == 127 + 16 // 2
    scores = technique.similarity(describe(technique, dot), describe(technique, 255 - dot))
    assert 0 <= scores.item() < 1
    black, white = np.zeros((32, 64), np.uint8), np.full((32, 64), 255, np.uint8)
    black[0, 0], white[0, 0] = 1, 254
    plain = rt.technique("sad")
    assert plain.similarity(describe(plain, black), describe(plain, white)).item() < 1e-4


@pytest.mark.parametrize("name", ["sad", "patchnorm"])
@pytest.mark.parametrize("level", [0, 127, 255])
def test_a_flat_picture_has_no_descriptor_and_matches_nothing(name: str, level: int) -> None:
    technique = rt.technique(name)
    flat, some = np.full((48, 64), level, np.uint8), noise(3)
    flats, others = describe(technique, flat), describe(technique, some, noise(4))
    assert not flats.descriptor.any()
    assert technique.similarity(flats, others).tolist() == [[0, 0]]
    assert technique.similarity(others, flats).tolist() == [[0], [0]]
    route = rt.build_map(open_traverse([some, noise(4)]), technique)
    assert rt.match(open_traverse([flat]), route, sequence_length=1).reference.tolist() == [-1]


@pytest.mark.parametrize("name", ["sad", "patchnorm"])
@pytest.mark.parametrize(("resolution", "values"), [(0, 2048), (16, 256), (64, 4096)])
def test_sizes(name: str, resolution: int, values: int) -> None:
    technique = rt.technique(name, resolution=resolution)
    assert technique.layout.dimension == values
    assert describe(technique, noise(5, 90, 200)).descriptor.shape == (1, values)


def test_a_picture_of_the_thumbnail_s_size_stays_as_it_is() -> None:
    grey = noise(6)
    assert rt.technique("sad").describe(grey)["descriptor"].tolist() == grey.ravel().tolist()


@pytest.mark.parametrize("name", ["sad", "patchnorm"])
def test_a_map_survives_its_file(tmp_path: Path, name: str) -> None:
    route = rt.build_map(open_traverse([noise(7), noise(8)]), rt.technique(name))
    route.save(tmp_path / "map")
    frames = open_traverse([noise(7)])
    again = rt.similarity(frames, rt.load_map(tmp_path / "map"))
    np.testing.assert_array_equal(again, rt.similarity(frames, route))
    assert again.argmax() == 0


def test_grey_path_is_the_one_named() -> None:
    frame = Frame.from_array(np.dstack([noise(9)] * 3), name="grey", index=0)
    np.testing.assert_array_equal(rt.technique("sad").read(frame), noise(9))


@pytest.mark.parametrize(
    ("name", "parameters", "said"),
    [
        ("sad", {"resolution": 4}, "8 to 1024"),
        ("sad", {"difference": "squared"}, "'absolute', 'saturating'"),
        ("sad", {"patch": 8}, "unknown parameter"),
        ("patchnorm", {"patch": 1}, "2 to 64"),
        ("patchnorm", {"patch": 5}, "divisor of the thumbnail's 64 x 32"),
        ("patchnorm", {"resolution": 20}, "divisor of the thumbnail's 20 x 20"),
    ],
)
def test_parameters_out_of_range(name: str, parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        rt.technique(name, **parameters)
