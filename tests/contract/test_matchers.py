"""What every registered matcher promises; a new matcher is one row here: none, it is found."""

import gc
import tracemalloc
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, asdict, fields
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.matching.matchers import Answer, MatcherInfo, describe_matcher
from retraverse.types import FloatArray

K = 10


def variants() -> Iterator[tuple[str, dict[str, Any]]]:
    """Every matcher with its defaults, and once with each other choice it offers."""
    for info in rt.matchers():
        yield info.name, {}
        for item in info.parameters:
            for choice in item.choices:
                if choice != item.default:
                    yield info.name, {item.name: choice}


VARIANTS = list(variants())


@pytest.fixture(params=VARIANTS, ids=lambda variant: "-".join([variant[0], *variant[1].values()]))
def matcher(request: pytest.FixtureRequest) -> rt.Matcher:
    name, parameters = request.param
    return rt.matcher(name, **parameters)


def info_of(matcher: rt.Matcher) -> MatcherInfo:
    return next(info for info in rt.matchers() if info.name == matcher.name)


def noisy(n_queries: int, n_references: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).normal(size=(n_queries, n_references)).astype(np.float32)


def drive(n_queries: int = 60, n_references: int = 80, first: int = 10, seed: int = 0) -> Any:
    """Return similarities of a drive that begins at reference `first` and runs at the map's speed.

    Noise has deviation 1, the true pairs stand out by 3 and their neighbours by 1.
    """
    scores = noisy(n_queries, n_references, seed)
    for query in range(n_queries):
        for beside, height in ((-1, 1), (0, 3), (1, 1)):
            if 0 <= first + query + beside < n_references:
                scores[query, first + query + beside] += height
    return scores


def answers(matcher: rt.Matcher, similarity: Any, sequence_length: int = K) -> rt.Matches:
    return rt.match_similarity(similarity, sequence_length=sequence_length, matcher=matcher)


def test_listing_says_what_it_is() -> None:
    assert {info.name for info in rt.matchers()} == {
        "auto", "balanced", "dtw", "graph", "hmm", "mean", "openseqslam2", "seqslam",
    }  # fmt: skip
    for info in rt.matchers():
        assert info.summary
        assert info.cost
        assert info.assumes
        assert "," in info.citation
        assert all(parameter.help for parameter in info.parameters)


def test_answers_are_well_formed(matcher: rt.Matcher) -> None:
    matches = answers(matcher, drive())
    n_windows = len(matches)
    assert (matches.n_queries, matches.n_references) == (60, 80)
    assert 0 < n_windows <= 60
    assert (np.diff(matches.query) > 0).all()
    for name, kind in (("reference", "i"), ("score", "f"), ("sequence_length", "i")):
        array = getattr(matches, name)
        assert array.shape == (n_windows,)
        assert array.dtype.kind == kind
    assert matches.score.dtype == np.float32
    assert np.isfinite(matches.score).all()
    assert matches.reference.min() >= -1
    assert matches.reference.max() < 80
    assert matches.sequence_length.min() >= 1
    assert matches.sequence_length.max() <= 60


def test_every_frame_has_an_answer_of_its_own(matcher: rt.Matcher) -> None:
    matches = answers(matcher, drive())
    frames = matches.by_frame()
    assert matches.frame_reference.shape == (60,)
    np.testing.assert_array_equal(frames.query, np.arange(60))
    np.testing.assert_array_equal(frames.reference, matches.frame_reference)
    np.testing.assert_array_equal(frames.reference[matches.query], matches.reference)
    np.testing.assert_array_equal(frames.score[matches.query], matches.score)
    assert rt.evaluate(frames, rt.aligned(60, 80, tolerance=2)).n_answered == 60


def test_a_drive_at_the_maps_speed_is_followed(matcher: rt.Matcher) -> None:
    if getattr(matcher.parameters, "search", "") == "cone":
        pytest.skip(
            "the cone counts hits of locally enhanced minima: noise of this size hides them"
        )
    if getattr(matcher.parameters, "scope", "") == "global":
        pytest.skip("a part of the map is no drive from end to end")
    off = np.abs(answers(matcher, drive()).frame_reference - np.arange(10, 70))
    assert (off <= 2).mean() > 0.85


def test_a_clean_drive_is_found_everywhere(matcher: rt.Matcher) -> None:
    frames = answers(matcher, np.eye(40, dtype=np.float32)).frame_reference
    np.testing.assert_array_equal(frames, np.arange(40))


def test_same_matrix_same_answers(matcher: rt.Matcher) -> None:
    scores = drive()
    before = scores.copy()
    first, second = answers(matcher, scores), answers(matcher, np.asfortranarray(scores))
    np.testing.assert_array_equal(scores, before)
    np.testing.assert_array_equal(first.reference, second.reference)
    np.testing.assert_array_equal(first.score, second.score)


@pytest.mark.parametrize(("factor", "shift"), [(4.0, 0.0), (0.25, 0.0), (2.0, 3.0)])
def test_the_scale_of_scores_plays_no_part(
    matcher: rt.Matcher, factor: float, shift: float
) -> None:
    scores = (np.round(drive() * 64) / 64).astype(np.float32)
    first, second = answers(matcher, scores), answers(matcher, scores * factor + shift)
    np.testing.assert_array_equal(first.frame_reference, second.frame_reference)


@pytest.mark.parametrize("matrix", ["constant", "constant_rows"])
def test_no_information_is_no_match(matcher: rt.Matcher, matrix: str) -> None:
    scores = np.full((30, 40), 0.1, np.float32)
    if matrix == "constant_rows":
        scores += np.random.default_rng(0).random((30, 1), np.float32)
    matches = answers(matcher, scores)
    if "auto picked mean" in "".join(matches.notes) or matcher.name == "mean":
        assert (matches.reference == 0).all()
        return
    assert (matches.frame_reference == -1).all()


def test_identical_queries_have_answers(matcher: rt.Matcher) -> None:
    matches = answers(matcher, np.tile(noisy(1, 40), (30, 1)))
    assert np.isfinite(matches.score).all()


@pytest.mark.parametrize("n_references", [K + 2, 11 * K])
def test_queries_longer_and_shorter_than_the_map(matcher: rt.Matcher, n_references: int) -> None:
    matches = answers(matcher, noisy(5 * K, n_references))
    assert matches.frame_reference.max() < n_references
    assert matches.frame_reference.shape == (5 * K,)


def test_one_frame_is_enough_for_itself_or_said_not_to_be(matcher: rt.Matcher) -> None:
    row = noisy(1, 30)
    if matcher.name in ("seqslam",):
        with pytest.raises(InputError, match="needs at least 3"):
            answers(matcher, row, 1)
        return
    matches = answers(matcher, row, 1)
    assert len(matches) == 1


def test_a_map_of_one_frame(matcher: rt.Matcher) -> None:
    scores = noisy(20, 1)
    if matcher.name == "seqslam":
        with pytest.raises(InputError, match="the map has only 1 frames"):
            answers(matcher, scores, 1)
        return
    # Nothing stands out where there is nothing else; only the plain mean does not ask for it.
    expected = 0 if matcher.name == "mean" else -1
    assert (answers(matcher, scores, 1).frame_reference == expected).all()


@pytest.mark.parametrize(
    ("shape", "sequence_length", "said"),
    [
        ((K - 1, 40), K, "the query has only 9 frames"),
        ((40, K - 1), K, "the map has only 9 frames"),
        ((1, 40), K, "the query has only 1 frames"),
        ((0, 40), 1, "the query has only 0 frames"),
        ((40, 0), 1, "the map has only 0 frames"),
    ],
)
def test_too_few_frames(
    matcher: rt.Matcher, shape: tuple[int, int], sequence_length: int, said: str
) -> None:
    for match in (answers, lambda chosen, scores, k: chosen.match(scores, k)):
        with pytest.raises(InputError, match=said):
            match(matcher, np.zeros(shape, np.float32), sequence_length)


@pytest.mark.parametrize("sequence_length", [0, -3, 2.5, True, "dynamic"])
def test_sequence_lengths_that_make_no_sense(matcher: rt.Matcher, sequence_length: Any) -> None:
    with pytest.raises(ConfigError, match="expected a whole number"):
        answers(matcher, noisy(30, 30), sequence_length)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_scores_that_are_not_finite(matcher: rt.Matcher, bad: float) -> None:
    scores = noisy(30, 30)
    scores[7, 3] = bad
    with pytest.raises(ShapeError, match="at query 7, reference 3"):
        answers(matcher, scores)
    with pytest.raises(ShapeError, match="at query 7, reference 3"):
        matcher.match(scores, K)


def test_one_axis(matcher: rt.Matcher) -> None:
    with pytest.raises(ShapeError, match="1 axes"):
        answers(matcher, np.zeros(30, np.float32))


def test_unknown_matcher_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"dtw, graph, hmm, mean.*did you mean 'seqslam'"):
        rt.match_similarity(noisy(30, 30), matcher="seqslm")


def test_parameters_are_checked_by_name(matcher: rt.Matcher) -> None:
    with pytest.raises(ConfigError, match="unknown parameter of"):
        rt.matcher(matcher.name, no_such_parameter=1)
    for field in fields(matcher.parameters):
        with pytest.raises(FrozenInstanceError):
            setattr(matcher.parameters, field.name, None)


def test_parameters_may_come_as_text(matcher: rt.Matcher) -> None:
    texts = {name: str(value) for name, value in asdict(matcher.parameters).items()}
    assert rt.matcher(matcher.name, **texts).parameters == matcher.parameters


def test_numbers_out_of_range_are_refused() -> None:
    for info in rt.matchers():
        for item in info.parameters:
            if not item.choices:
                with pytest.raises(ConfigError, match=item.name):
                    rt.matcher(info.name, **{item.name: -1e6})


def test_description_names_what_is_not_default() -> None:
    assert describe_matcher(rt.matcher("mean")) == "mean"
    assert describe_matcher(rt.matcher("seqslam", index="original")) == "seqslam(index=original)"


def run_online(matcher: rt.Matcher, scores: FloatArray) -> list[Answer]:
    online = matcher.online(scores.shape[1], K)
    found = [online.update(row) for row in scores]
    return [answer for answer in found if answer is not None] + online.finish()


def test_frame_by_frame_gives_the_same_answers(matcher: rt.Matcher) -> None:
    needs_all = {"viterbi", "smooth", "whole", "drive"} & set(vars(matcher.parameters).values())
    if needs_all or not info_of(matcher).frame_by_frame:
        with pytest.raises(ConfigError, match="needs the whole drive"):
            matcher.online(80, K)
        return
    for seed in range(5):
        scores = drive(seed=seed)
        matches, online = answers(matcher, scores), run_online(matcher, scores)
        assert [answer.query for answer in online] == matches.query.tolist()
        assert [answer.reference for answer in online] == matches.reference.tolist()
        # SeqSLAM's scores take the least difference of the whole drive, known at its end only.
        from_row = len(online) - 1 if "seqslam" in matcher.name else 0
        np.testing.assert_allclose(
            [answer.score for answer in online[from_row:]], matches.score[from_row:], atol=2e-6
        )


def test_frame_by_frame_refuses_wrong_rows(matcher: rt.Matcher) -> None:
    try:
        online = matcher.online(30, K)
    except ConfigError:
        return
    for row in (np.zeros(29), np.zeros((1, 30))):
        with pytest.raises(ShapeError, match=r"expected \(30,\)"):
            online.update(row.astype(np.float32))
    with pytest.raises(ShapeError, match="expected finite"):
        online.update(np.full(30, np.nan, np.float32))
    with pytest.raises(InputError, match="the map has only 9 frames"):
        matcher.online(K - 1, K)


def test_memory_does_not_grow_frame_by_frame(matcher: rt.Matcher) -> None:
    try:
        online = matcher.online(4000, K)
    except ConfigError:
        return
    rows = noisy(60, 4000)
    tracemalloc.start()
    try:
        peaks = []
        for part in np.split(rows, 3):
            for row in part:
                online.update(row)
            gc.collect()
            peaks.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert peaks[2] - peaks[1] < 2 * rows[0].nbytes  # keeping the rows would take 20
