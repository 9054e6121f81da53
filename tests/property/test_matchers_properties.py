"""What changing speed, absence, more map and other orders must do to every matcher's answers."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import retraverse as rt
from retraverse.types import FloatArray, IntArray

K = 10
ANY_SPEED = [
    ("dtw", {}),
    ("hmm", {}),
    ("hmm", {"decode": "lag"}),
    ("hmm", {"decode": "viterbi"}),
    ("hmm", {"decode": "smooth"}),
    ("graph", {}),
    ("graph", {"decode": "whole"}),
    ("auto", {}),
]  # fmt: skip
STEADY_SPEED = [("seqslam", {}), ("openseqslam2", {}), ("openseqslam2", {"search": "hybrid"})]
seeds = st.integers(0, 2**32 - 1)


def along(path: IntArray, n_references: int, seed: int, height: float = 4.0) -> FloatArray:
    """Return noise of deviation 1 from which the path stands out, its neighbours half as much.

    Frames with path -1 are noise only.
    """
    scores = np.random.default_rng(seed).normal(size=(len(path), n_references))
    for query, place in enumerate(path.tolist()):
        for beside in (-1, 0, 1):
            if place >= 0 and 0 <= place + beside < n_references:
                scores[query, place + beside] += height / (1 + abs(beside))
    return scores.astype(np.float32)


def frames_of(name: str, parameters: dict[str, Any], scores: FloatArray) -> IntArray:
    matcher = rt.matcher(name, **parameters)
    return rt.match_similarity(scores, sequence_length=K, matcher=matcher).frame_reference


def drive_at(speed: Callable[[int], float], n_references: int) -> IntArray:
    """Return the path of a drive over the whole map at a speed that depends on the place."""
    place, path = 0.0, []
    while place <= n_references - 1:
        path.append(round(place))
        place += speed(round(place))
    return np.array(path)


@pytest.mark.parametrize(("name", "parameters"), [*ANY_SPEED, ("dtw", {"scope": "global"})])
@pytest.mark.parametrize("speeds", [(0.5, 2.0), (2.0, 0.5), (0.5, 1.0), (1.0, 2.0)])
@settings(max_examples=5, deadline=None)
@given(seed=seeds)
def test_changing_speed_is_followed(
    name: str, parameters: dict[str, Any], speeds: tuple[float, float], seed: int
) -> None:
    path = drive_at(lambda place: speeds[place // 30 % 2], 150)
    off = np.abs(frames_of(name, parameters, along(path, 150, seed)) - path)
    assert (off <= 2).mean() > 0.9


@pytest.mark.parametrize(("name", "parameters"), [*ANY_SPEED[:-1], ("auto", {})])
def test_stops_are_followed(name: str, parameters: dict[str, Any]) -> None:
    path = np.concatenate([np.arange(40), np.full(25, 40), np.arange(41, 100)])
    off = np.abs(frames_of(name, parameters, along(path, 110, seed=1)) - path)
    assert (off <= 2).mean() > 0.9


@pytest.mark.parametrize(("name", "parameters"), STEADY_SPEED)
@pytest.mark.parametrize("speed", [0.8, 0.9, 1.0, 1.1, 1.2])
@settings(max_examples=5, deadline=None)
@given(seed=seeds)
def test_steady_speeds_are_followed(
    name: str, parameters: dict[str, Any], speed: float, seed: int
) -> None:
    path = drive_at(lambda _: speed, 120)
    off = np.abs(frames_of(name, parameters, along(path, 120, seed, height=8)) - path)
    assert (off <= 2).mean() > 0.9


@pytest.mark.parametrize("decode", ["filter", "lag", "viterbi", "smooth"])
def test_backward_drives_are_followed_where_allowed(decode: str) -> None:
    path = np.arange(99, 9, -1)
    scores = along(path, 110, seed=2, height=6)
    off = np.abs(frames_of("hmm", {"decode": decode}, scores) - path)
    assert (off <= 2).mean() > 0.9
    forward_only = frames_of("hmm", {"decode": decode, "back": 0}, scores)
    assert (np.abs(forward_only - path) <= 2).mean() < 0.8


FINDS_ABSENCE = [item for item in ANY_SPEED if item[0] in ("hmm", "graph", "auto")]


@pytest.mark.parametrize(("name", "parameters"), FINDS_ABSENCE)
@settings(max_examples=5, deadline=None)
@given(seed=seeds)
def test_leaving_the_map_and_coming_back_elsewhere(
    name: str, parameters: dict[str, Any], seed: int
) -> None:
    path = np.concatenate([np.arange(10, 60), np.full(50, -1), np.arange(120, 170)])
    found = frames_of(name, parameters, along(path, 200, seed))
    absent = path < 0
    # Some frames pass before a place is doubted, and chance likeness may hold it some more: of the
    # 50 absent frames a bad draw has cost the graph 13, so half of them is what can be promised.
    assert (found[absent] == -1).mean() > 0.5
    assert (np.abs(found - path)[~absent] <= 2).mean() > 0.85


@pytest.mark.parametrize(("name", "parameters"), FINDS_ABSENCE)
def test_a_drive_that_is_nowhere_on_the_map(name: str, parameters: dict[str, Any]) -> None:
    if name == "auto":
        pytest.skip("where nothing is known auto takes the balanced mean, which knows no absence")
    found = frames_of(name, parameters, along(np.full(200, -1), 300, seed=3))
    assert (found == -1).mean() > 0.9


@pytest.mark.parametrize(("name", "parameters"), FINDS_ABSENCE)
def test_a_kidnapped_robot_is_found_again(name: str, parameters: dict[str, Any]) -> None:
    path = np.concatenate([np.arange(10, 60), np.arange(130, 190)])
    off = np.abs(frames_of(name, parameters, along(path, 200, seed=4)) - path)
    assert (off <= 2).mean() > 0.85


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("mean", {}), ("openseqslam2", {}), ("seqslam", {}), ("hmm", {"decode": "viterbi"}),
     ("graph", {"evidence": "row"}), ("dtw", {})],
)  # fmt: skip
@settings(max_examples=5, deadline=None)
@given(seed=seeds, gap=st.integers(1, 30))
def test_references_in_front_move_every_answer(
    name: str, parameters: dict[str, Any], seed: int, gap: int
) -> None:
    path = np.arange(5, 65)
    before = along(path, 80, seed, height=8)
    unlike = np.random.default_rng(seed).normal(-1, 1, (60, gap)).astype(np.float32)
    padded = np.concatenate([unlike, before], axis=1)
    np.testing.assert_array_equal(
        frames_of(name, parameters, padded), frames_of(name, parameters, before) + gap
    )


@pytest.mark.parametrize("name", ["mean", "seqslam", "openseqslam2", "dtw", "hmm", "graph"])
@settings(max_examples=5, deadline=None)
@given(seed=seeds)
def test_light_of_single_frames_plays_no_part(name: str, seed: int) -> None:
    """A row of scores that is higher as a whole changes nothing but the mean's scores."""
    scores = along(np.arange(5, 65), 80, seed)
    lit = scores + np.random.default_rng(seed).integers(0, 9, (60, 1)).astype(np.float32)
    np.testing.assert_array_equal(frames_of(name, {}, lit), frames_of(name, {}, scores))


@pytest.mark.parametrize(
    ("path", "picked", "why"),
    [
        (np.arange(10, 110), "hmm", "a steady 1.00 times the map's"),
        (drive_at(lambda _: 1.18, 140), "hmm", r"a steady 1\.1\d times"),
        (drive_at(lambda place: (0.5, 2.0)[place // 40 % 2], 140), "hmm", "the speed changes"),
        (np.concatenate([np.arange(60), np.full(60, -1)]), "hmm", "off the map for [45]\\d%"),
        (np.full(120, -1), "balanced", "clear enough"),
    ],
)
def test_auto_says_why(path: IntArray, picked: str, why: str) -> None:
    matches = rt.match_similarity(along(path, 140, seed=5), matcher="auto")
    assert matches.notes[0].startswith(f"auto picked {picked}: ")
    assert re.search(why, matches.notes[0]), matches.notes[0]
