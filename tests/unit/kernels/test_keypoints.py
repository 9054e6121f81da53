"""Matching of binary keypoints: OpenCV's answer on every instruction set and in NumPy."""

from typing import Any

import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.kernels import instruction_sets, keypoint_matches, keypoints

SETS = [*instruction_sets(), "numpy"]


def on(name: str, monkeypatch: pytest.MonkeyPatch) -> str | None:
    """Return the instruction set to ask for; None where the NumPy twin was put in place."""
    if name != "numpy":
        return name
    monkeypatch.setattr(keypoints, "native", lambda: None)
    return None


def descriptors(seed: int, n_frames: int, n_keypoints: int, levels: int) -> Any:
    print("seed", seed)
    random = np.random.default_rng(seed)
    return random.integers(0, levels, (n_frames, n_keypoints, 32)).astype(np.uint8)


def counts(*numbers: int) -> Any:
    return np.array(numbers, np.int32)


def opencv_matches(query: Any, reference: Any, max_distance: int) -> int:
    if not len(query) or not len(reference):
        return 0
    found = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(query, reference)
    return sum(match.distance <= max_distance for match in found)


# Bytes of 3 or 2 levels have few different bits: most distances are equal to many others.
@pytest.mark.parametrize("levels", [256, 3, 2], ids=["any bits", "many ties", "mostly ties"])
@pytest.mark.parametrize("max_distance", [256, 100, 12, 0])
@pytest.mark.parametrize("instruction_set", SETS)
def test_as_opencv(
    instruction_set: str, max_distance: int, levels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    queries, references = descriptors(1, 4, 70, levels), descriptors(2, 5, 90, levels)
    references[0, 5:25] = queries[0, 40:60]
    query_counts, reference_counts = counts(70, 1, 33, 0), counts(90, 31, 32, 1, 0)
    found = keypoint_matches(
        queries,
        query_counts,
        references,
        reference_counts,
        max_distance=max_distance,
        instruction_set=on(instruction_set, monkeypatch),
    )
    expected = [
        [
            opencv_matches(query[:n], reference[:m], max_distance)
            for reference, m in zip(references, reference_counts, strict=True)
        ]
        for query, n in zip(queries, query_counts, strict=True)
    ]
    assert found.dtype == np.int32
    assert found.tolist() == expected
    assert levels == 256 or max_distance == 0 or found.max() > 10


@pytest.mark.parametrize("instruction_set", SETS)
def test_copies_find_each_other_at_distance_0(
    instruction_set: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture, n = descriptors(3, 1, 200, 256), counts(200)
    shuffled = picture[:, np.random.default_rng(3).permutation(200)].copy()
    newest = on(instruction_set, monkeypatch)
    ask: Any = {"max_distance": 0, "instruction_set": newest}
    assert keypoint_matches(picture, n, shuffled, n, **ask).item() == 200
    opposite = ~shuffled
    assert keypoint_matches(picture, n, opposite, n, **ask).item() == 0
    same = np.repeat(picture[:, :1], 200, axis=1)
    assert keypoint_matches(same, n, same, n, **ask).item() == 1


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_any_number_of_threads(threads: int) -> None:
    queries, references = descriptors(4, 2, 120, 256), descriptors(5, 9, 150, 256)
    found = keypoint_matches(
        queries, counts(120, 90), references, counts(*[150] * 9), threads=threads
    )
    for row, n in enumerate((120, 90)):
        assert found[row].tolist() == [opencv_matches(queries[row, :n], r, 256) for r in references]


def test_nobody_matches_nothing() -> None:
    some, n = descriptors(6, 3, 10, 256), counts(10, 10, 10)
    assert keypoint_matches(some[:0], n[:0], some, n).shape == (0, 3)
    assert keypoint_matches(some, n, some[:0], n[:0]).shape == (3, 0)
    none = counts(0, 0, 0)
    assert not keypoint_matches(some, none, some, n).any()
    assert not keypoint_matches(some, n, some, none).any()
    assert not keypoint_matches(some[:, :0], none, some, n).any()


def test_most_keypoints_fit() -> None:
    many = np.zeros((1, keypoints.MOST_KEYPOINTS, 32), np.uint8)
    few = descriptors(7, 1, 3, 256)
    many[0, -1] = few[0, 1]
    n = counts(keypoints.MOST_KEYPOINTS)
    found = keypoint_matches(few, counts(3), many, n, max_distance=0)
    assert found.tolist() == keypoint_matches(many, n, few, counts(3), max_distance=0).tolist()
    assert found.item() == 1


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"queries": np.zeros((1, 4, 32))}, ShapeError, "queries are float64"),
        ({"references": np.zeros((1, 4, 16), np.uint8)}, ShapeError, "expected uint8"),
        ({"references": np.zeros((4, 32), np.uint8)}, ShapeError, "expected uint8"),
        ({"queries": np.zeros((1, 16001, 32), np.uint8)}, ShapeError, "at most 16000"),
        ({"query_counts": np.array([4])}, ShapeError, "int64"),
        ({"reference_counts": counts(1, 1)}, ShapeError, r"expected int32 \(1,\)"),
        ({"query_counts": counts(5)}, InputError, "expected 0 to 4"),
        ({"reference_counts": counts(-1)}, InputError, "from -1"),
        ({"max_distance": 257}, ConfigError, "0 to 256"),
        ({"threads": 0}, ConfigError, "at least 1"),
        ({"instruction_set": "mmx"}, ConfigError, "'mmx' is not here"),
    ],
)
def test_wrong_input(change: dict[str, Any], error: type[Exception], said: str) -> None:
    picture = np.zeros((1, 4, 32), np.uint8)
    arguments = {"queries": picture, "query_counts": counts(4), "references": picture}
    with pytest.raises(error, match=said):
        keypoint_matches(**{**arguments, "reference_counts": counts(4), **change})
