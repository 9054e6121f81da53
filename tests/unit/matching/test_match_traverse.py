"""What matching refuses, what it answers with "no match", and how many answers it gives."""

import logging
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import retraverse as rt
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.matching import describe_query
from retraverse.matching.match_traverse import match_windows, query_windows
from retraverse.types import ImageArray


def street(n_frames: int, seed: int = 0) -> list[ImageArray]:
    """Return overlapping views of one long random picture: neighbours look alike."""
    random = np.random.default_rng(seed)
    coarse = random.integers(0, 256, (12, 10 + 2 * n_frames)).astype(np.uint8)
    scene = np.kron(coarse, np.ones((8, 8), np.uint8))
    return [scene[:, 16 * i : 16 * i + 96] for i in range(n_frames)]


@pytest.fixture(scope="module")
def route() -> rt.RouteMap:
    return rt.build_map(rt.open_traverse(street(20)), rt.technique("hog", form="chapter6"))


def regional_route(frames: list[ImageArray], **parameters: object) -> rt.RouteMap:
    technique = rt.technique("convsequential", resolution=96, **parameters)
    return rt.build_map(rt.open_traverse(frames), technique)


def test_the_same_drive_is_found_frame_by_frame(route: rt.RouteMap) -> None:
    for sequence_length in (1, 5, 20):
        matches = rt.match(rt.open_traverse(street(20)), route, sequence_length=sequence_length)
        np.testing.assert_array_equal(matches.reference, np.arange(21 - sequence_length))
        np.testing.assert_allclose(matches.score, 1, atol=1e-5)
        assert matches.n_unanswered == sequence_length - 1


def test_a_part_of_the_drive_is_found(route: rt.RouteMap) -> None:
    matches = rt.match(rt.open_traverse(street(20)[6:15]), route, sequence_length=4)
    np.testing.assert_array_equal(matches.reference, np.arange(6, 12))
    assert (matches.n_queries, matches.n_references) == (9, 20)


def test_match_and_match_similarity_agree(route: rt.RouteMap) -> None:
    query = rt.open_traverse(street(20, seed=3))
    scores = rt.similarity(query, route)
    matches = rt.match(query, route, sequence_length=3)
    again = rt.match_similarity(scores, sequence_length=3)
    np.testing.assert_array_equal(matches.reference, again.reference)
    np.testing.assert_array_equal(matches.score, again.score)


def test_threshold_answers_no_match(route: rt.RouteMap) -> None:
    query = rt.open_traverse([*street(20)[:10], *street(10, seed=9)])
    matches = rt.match(query, route, sequence_length=1, threshold=0.99)
    np.testing.assert_array_equal(matches.reference[:10], np.arange(10))
    assert (matches.reference[10:] == -1).all()
    assert len(matches) == 20


def test_frames_without_descriptor_are_answered_no_match(route: rt.RouteMap) -> None:
    frames = street(20)[:6]
    frames[2] = np.zeros_like(frames[2])
    single = rt.match(rt.open_traverse(frames), route, sequence_length=1)
    assert single.reference.tolist() == [0, 1, -1, 3, 4, 5]
    windows = rt.match(rt.open_traverse(frames), route, sequence_length=2)
    assert (windows.reference >= 0).all()


def test_all_black_drive_has_no_place_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    route = regional_route(street(8))
    black = rt.open_traverse([np.zeros((96, 96), np.uint8)] * 8)
    with caplog.at_level(logging.WARNING):
        for sequence_length in (1, 3):
            matches = rt.match(black, route, sequence_length=sequence_length)
            assert (matches.reference == -1).all()
            assert np.isfinite(matches.score).all()
        assert (rt.match(black, route, sequence_length="dynamic").reference == -1).all()
    assert len([record for record in caplog.records if "roi_entropy" in record.message]) == 1


def test_too_small_pictures_have_no_place() -> None:
    technique = rt.technique("cohog", resolution=16)
    assert technique.layout.dimension == 0
    route = rt.build_map(rt.open_traverse(street(5)), technique)
    matches = rt.match(rt.open_traverse(street(5)), route, sequence_length=1)
    assert (matches.reference == -1).all()


def test_dynamic_windows_are_never_longer_than_the_map() -> None:
    route = regional_route(street(3))
    matches = rt.match(rt.open_traverse(street(12)), route, sequence_length="dynamic")
    assert matches.sequence_length.max() <= 3
    assert len(matches) > 0


def test_any_technique_chooses_its_lengths(route: rt.RouteMap) -> None:
    query = rt.open_traverse(street(20))
    matches = rt.match(query, route, sequence_length="dynamic")
    np.testing.assert_array_equal(matches.reference, np.arange(len(matches)))
    assert matches.sequence_length.min() >= 1
    assert len(matches) > 0


@pytest.mark.parametrize("roi", ["first", "each"])
def test_int8_finds_the_same_places(roi: str) -> None:
    random = np.random.default_rng(1)
    noisy = [
        np.clip(frame + random.normal(0, 20, frame.shape), 0, 255).astype(np.uint8)
        for frame in street(16)
    ]
    answers = [
        rt.match(
            rt.open_traverse(noisy),
            regional_route(street(16), roi=roi, precision=precision),
            sequence_length=3,
        )
        for precision in ("float32", "int8")
    ]
    np.testing.assert_allclose(answers[1].score, answers[0].score, atol=2e-3)
    assert (answers[0].reference == answers[1].reference).mean() > 0.9


@pytest.mark.parametrize(
    ("sequence_length", "error", "said"),
    [
        (0, ConfigError, "whole number from 1"),
        (-1, ConfigError, "whole number from 1"),
        (2.5, ConfigError, "whole number from 1"),
        (True, ConfigError, "whole number from 1"),
        ("long", ConfigError, "or 'dynamic'"),
        (21, InputError, "has only 20 frames"),
    ],
)
def test_sequence_lengths_that_make_no_sense(
    route: rt.RouteMap, sequence_length: object, error: type[Exception], said: str
) -> None:
    query = rt.open_traverse(street(20))
    with pytest.raises(error, match=said):
        rt.match(query, route, sequence_length=sequence_length)  # type: ignore[arg-type]


def test_map_shorter_than_the_window(route: rt.RouteMap) -> None:
    with pytest.raises(InputError, match="the map has only 20 frames"):
        rt.match(rt.open_traverse(street(30)), route, sequence_length=25)


@pytest.mark.parametrize(
    ("matrix", "K", "error", "said"),
    [
        (np.zeros((3, 4, 2)), 1, ShapeError, "3 axes"),
        (np.array([[0, 1], [np.nan, 0]]), 1, InputError, "query 1, reference 0"),
        (np.array([[0, 1], [0, np.inf]]), 1, InputError, "query 1, reference 1"),
        (np.zeros((3, 5)), 4, InputError, "the query has only 3 frames"),
        (np.zeros((5, 3)), 4, InputError, "the map has only 3 frames"),
        (np.zeros((0, 3)), 1, InputError, "has only 0 frames"),
    ],
)
def test_matrices_that_make_no_sense(
    matrix: np.ndarray, K: int, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        rt.match_similarity(matrix, sequence_length=K)


def test_unknown_matcher(route: rt.RouteMap) -> None:
    with pytest.raises(ConfigError, match=r"mean.*did you mean 'dtw'"):
        rt.match_similarity(np.zeros((3, 3), np.float32), sequence_length=1, matcher="dwt")
    with pytest.raises(ConfigError, match="unknown matcher"):
        rt.match(rt.open_traverse(street(20)), route, sequence_length=1, matcher="dwt")


@pytest.mark.parametrize("name", [info.name for info in rt.matchers()])
def test_every_matcher_finds_the_same_drive(route: rt.RouteMap, name: str) -> None:
    query = rt.open_traverse(street(20))
    matches = rt.match(query, route, sequence_length=4, matcher=name)
    again = rt.match_similarity(rt.similarity(query, route), sequence_length=4, matcher=name)
    np.testing.assert_array_equal(matches.reference, again.reference)
    np.testing.assert_array_equal(matches.score, again.score)
    assert (np.abs(matches.frame_reference - np.arange(20)) <= 1).mean() > 0.8
    refused = rt.match(query, route, sequence_length=4, matcher=rt.matcher(name), threshold=1e9)
    assert (refused.frame_reference == -1).all()


def test_only_the_mean_takes_dynamic_windows() -> None:
    route = regional_route(street(12))
    with pytest.raises(ConfigError, match="the matcher hmm does not offer it"):
        rt.match(rt.open_traverse(street(12)), route, sequence_length="dynamic", matcher="hmm")


def test_other_matchers_say_whose_region_of_interest_they_took() -> None:
    query = rt.open_traverse(street(12))
    for roi, expected in (("first", 1), ("each", 0)):
        route = regional_route(street(12), roi=roi)
        matches = rt.match(query, route, sequence_length=3, matcher="dtw")
        assert len([note for note in matches.notes if "region of interest" in note]) == expected
        assert rt.match(query, route, sequence_length=3).notes == ()


def test_black_frames_are_bridged_or_refused(route: rt.RouteMap) -> None:
    frames = street(20)
    frames[9] = np.zeros_like(frames[9])
    query = rt.open_traverse(frames)
    path = rt.match(query, route, sequence_length=4, matcher="dtw").frame_reference
    assert abs(path[9] - 9) <= 1
    black = rt.open_traverse([np.zeros((96, 96), np.uint8)] * 12)
    for name in ("seqslam", "openseqslam2", "dtw", "hmm", "graph"):
        matches = rt.match(black, route, sequence_length=4, matcher=name)
        assert (matches.frame_reference == -1).all()


@given(seed=st.integers(0, 2**32 - 1), K=st.integers(1, 6), gap=st.integers(0, 20))
def test_references_in_front_move_every_answer(seed: int, K: int, gap: int) -> None:
    scores = np.random.default_rng(seed).random((12, 9), np.float32)
    before = rt.match_similarity(scores, sequence_length=K)
    padded = np.concatenate([np.full((12, gap), -100, np.float32), scores], axis=1)
    after = rt.match_similarity(padded, sequence_length=K)
    np.testing.assert_array_equal(after.reference, before.reference + gap)


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.1, 10))
def test_scaling_scores_changes_no_answer(seed: int, scale: float) -> None:
    scores = np.random.default_rng(seed).integers(0, 100, (10, 10)).astype(np.float32)
    before = rt.match_similarity(scores, sequence_length=2)
    after = rt.match_similarity(scores * np.float32(2.0 ** round(scale)), sequence_length=2)
    np.testing.assert_array_equal(after.reference, before.reference)


@pytest.mark.parametrize("roi", ["first", "each"])
@pytest.mark.parametrize("with_scores", [True, False])
def test_all_lengths_in_one_pass_as_one_by_one(roi: str, with_scores: bool) -> None:
    random = np.random.default_rng(2)
    noisy = [
        np.clip(frame + random.normal(0, 40, frame.shape), 0, 255).astype(np.uint8)
        for frame in street(14)
    ]
    # Dark and flat parts, so that regions of interest differ from frame to frame.
    for index, frame in enumerate(noisy):
        frame[:, : 4 * index] = 0
    route = regional_route(street(17), roi=roi)
    queries = describe_query(rt.open_traverse(noisy), route)
    lengths: list[rt.SequenceLength] = [4, 1, "dynamic", 14, 2, 4]
    choices = [query_windows(queries, route, length) for length in lengths]
    scores = rt.similarity(queries, route) if with_scores else None
    together = match_windows(queries, route, choices, scores=scores)
    assert len(set(choices[2].tolist())) > 1, "dynamic windows of one length prove little"
    for length, found in zip(lengths, together, strict=True):
        alone = rt.match(queries, route, sequence_length=length)
        np.testing.assert_array_equal(found.reference, alone.reference)
        np.testing.assert_allclose(found.score, alone.score, rtol=1e-6)
        np.testing.assert_array_equal(found.sequence_length, alone.sequence_length)
    if roi == "first":
        own = rt.match_similarity(rt.similarity(queries, route), sequence_length=4)
        assert not np.allclose(own.score, together[0].score, rtol=1e-6), "the ROI tells nothing"


def test_one_pass_scores_each_query_frame_once(monkeypatch: pytest.MonkeyPatch) -> None:
    route = regional_route(street(12), roi="first")
    queries = describe_query(rt.open_traverse(street(12)), route)
    choices = [query_windows(queries, route, length) for length in (2, 5, 9)]
    seen: list[int] = []
    regional: Any = type(route.technique)
    plain = regional.weighted_similarity

    def counted(self: Any, query: Any, references: Any, weights: Any) -> Any:
        seen.append(len(weights))
        return plain(self, query, references, weights)

    monkeypatch.setattr(regional, "weighted_similarity", counted)
    match_windows(queries, route, choices)
    assert len(seen) == 12, "one call for each query frame"
    assert max(seen) == 9, "no more windows are open than the longest has frames"


def test_no_choice_no_answer(route: rt.RouteMap) -> None:
    queries = describe_query(rt.open_traverse(street(3)), route)
    assert match_windows(queries, route, []) == ()
