"""ORB: OpenCV's keypoints and matches, no keypoints as an answer, wrong parameters."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.images import Frame, Traverse, open_traverse
from retraverse.matching import describe_query

Shared = Callable[[str], Path]


def street(seed: int, height: int = 180, width: int = 240) -> Any:
    """Return a picture with corners: boxes of many sizes and greys."""
    print("seed", seed)
    random = np.random.default_rng(seed)
    picture = np.full((height, width), 120, np.uint8)
    for _ in range(80):
        x, y = int(random.integers(0, width)), int(random.integers(0, height))
        size = tuple(int(side) for side in random.integers(4, 40, 2))
        cv2.rectangle(picture, (x, y, *size), int(random.integers(0, 256)), -1)
    return picture


def traverse(*pictures: Any) -> Traverse:
    return open_traverse(list(pictures))


def opencv_similarity(query: Any, reference: Any, n_features: int, max_distance: int) -> float:
    orb = cv2.ORB.create(n_features)
    ours, theirs = (orb.detectAndCompute(picture, None)[1] for picture in (query, reference))
    if ours is None or theirs is None:
        return 0.0
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(ours, theirs)
    return sum(match.distance <= max_distance for match in matches) / len(ours)


@pytest.mark.parametrize("max_distance", [50, 256])
def test_similarity_is_opencv_s(max_distance: int) -> None:
    places = [street(seed) for seed in range(4)]
    moved = [np.roll(place, (5, 9), axis=(0, 1)) for place in places]
    technique = rt.technique("orb", max_distance=max_distance)
    scores = rt.similarity(traverse(*moved), rt.build_map(traverse(*places), technique))
    expected = [[opencv_similarity(q, r, 500, max_distance) for r in places] for q in moved]
    np.testing.assert_allclose(scores, expected, rtol=1e-6)
    assert (scores.argmax(axis=1) == np.arange(4)).all()
    assert scores.dtype == np.float32


def test_corridor_as_opencv(shared: Shared) -> None:
    query = open_traverse(shared("data/corridor/query"), every=22)
    reference = open_traverse(shared("data/corridor/reference"), every=22)
    scores = rt.similarity(query, rt.build_map(reference, rt.technique("orb")))
    greys = [[frame.grey("from_colour") for frame in drive] for drive in (query, reference)]
    expected = [[opencv_similarity(q, r, 500, 50) for r in greys[1]] for q in greys[0]]
    np.testing.assert_allclose(scores, expected, rtol=1e-6)
    assert scores.max() > 0


def test_a_description_holds_opencv_s_descriptors_and_zeros() -> None:
    picture = street(5)
    described = rt.technique("orb").describe(picture)
    _, expected = cv2.ORB.create(500).detectAndCompute(picture, None)
    n = int(described["n_keypoints"])
    assert 50 < n == len(expected) < 500
    np.testing.assert_array_equal(described["descriptor"][:n], expected)
    assert not described["descriptor"][n:].any()


def test_of_too_many_keypoints_the_strongest_stay() -> None:
    # A regular pattern: all corners tie, and OpenCV keeps more of them than it was asked for.
    picture = np.kron(np.indices((14, 14)).sum(axis=0) % 2, np.ones((15, 15))).astype(np.uint8)
    picture *= 200
    assert len(cv2.ORB.create(30).detect(picture, None)) > 30
    described = rt.technique("orb", n_features=30).describe(picture)
    assert described["descriptor"].shape == (30, 32)
    assert described["n_keypoints"] == 30


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((200, 200), np.uint8),
        street(6)[:40, :40],
        street(6)[:62],
        street(6)[:1, :1],
        np.tile(np.arange(200, dtype=np.uint8), (200, 1)),
    ],
    ids=["black", "40 x 40", "62 high", "one pixel", "ramp"],
)
def test_no_keypoints_are_an_answer(picture: Any) -> None:
    technique = rt.technique("orb")
    assert technique.describe(np.ascontiguousarray(picture))["n_keypoints"] == 0
    route = rt.build_map(traverse(street(7), street(8)), technique)
    scores = rt.similarity(traverse(picture), route)
    assert scores.tolist() == [[0, 0]]
    assert rt.match(traverse(picture), route, sequence_length=1).reference.tolist() == [-1]
    empty = rt.build_map(traverse(picture), technique)
    assert rt.similarity(traverse(street(7)), empty).tolist() == [[0]]


def test_resolution_decides_whether_there_are_keypoints() -> None:
    pictures = traverse(street(9))
    found = []
    for resolution in (0, 256, 128, 32):
        technique = rt.technique("orb", resolution=resolution)
        route = rt.build_map(pictures, technique)
        found.append(int(describe_query(pictures, route).arrays["n_keypoints"][0]))
    assert found[1] > found[2] > found[3] == 0
    assert found[0] > 0


def test_resizing_is_pillow_s() -> None:
    from PIL import Image

    picture = street(10)
    small = np.asarray(Image.fromarray(picture).resize((128, 128)))
    ours = rt.technique("orb", resolution=128).describe(picture)
    np.testing.assert_array_equal(
        ours["descriptor"], rt.technique("orb").describe(small)["descriptor"]
    )


def test_a_map_with_keypoints_survives_its_file(tmp_path: Path) -> None:
    route = rt.build_map(traverse(street(11), street(12)), rt.technique("orb", n_features=200))
    route.save(tmp_path / "map")
    again = rt.load_map(tmp_path / "map")
    frame = traverse(street(11))
    np.testing.assert_array_equal(rt.similarity(frame, again), rt.similarity(frame, route))


def test_from_colour_is_the_default_grey() -> None:
    colour = np.stack([street(13), street(14), street(15)], axis=2)
    read = rt.technique("orb").read(Frame.from_array(colour, name="colour", index=0))
    np.testing.assert_array_equal(read, cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"resolution": 8}, "16 to 1024"),
        ({"resolution": -1}, "16 to 1024"),
        ({"n_features": 0}, "1 to 10000"),
        ({"n_features": 20000}, "1 to 10000"),
        ({"max_distance": 257}, "0 to 256"),
        ({"max_distance": -1}, "0 to 256"),
    ],
)
def test_parameters_out_of_range(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        rt.technique("orb", **parameters)
