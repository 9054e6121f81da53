import logging

import numpy as np
import pytest

from retraverse.datasets import GroundTruth, aligned, from_positives
from retraverse.errors import InputError, ShapeError

TRUTH = from_positives([[0, 1], [2], [], [1, 3]], 4, description="by hand")
LISTS = [[0, 1], [2], [], [1, 3]]


def lists(truth: GroundTruth) -> list[list[int]]:
    return [listed.tolist() for listed in truth.positives]


def test_what_it_knows() -> None:
    assert TRUTH.n_queries == 4
    assert TRUTH.has_match().tolist() == [True, True, False, True]
    assert TRUTH.matrix().astype(int).tolist() == [
        [1, 1, 0, 0],
        [0, 0, 1, 0],
        [0, 0, 0, 0],
        [0, 1, 0, 1],
    ]


def test_every_pair_is_judged_as_the_lists_say() -> None:
    for query in range(4):
        for reference in range(7):
            expected = reference in LISTS[query]
            assert bool(TRUTH.is_correct(query, reference)) is expected, (query, reference)


def test_no_match_is_right_where_there_is_none() -> None:
    assert TRUTH.is_correct(range(4), [-1] * 4).tolist() == [False, False, True, False]
    assert not TRUTH.is_correct([2, 1], [-2, -2]).any(), "only -1 means no match"


def test_nothing_to_judge() -> None:
    assert TRUTH.is_correct([], []).shape == (0,)
    assert from_positives([]).n_queries == 0
    nowhere = from_positives([[], []])
    assert nowhere.is_correct([0, 1, 1], [0, -1, 5]).tolist() == [False, True, False]


def test_query_outside_the_traverse() -> None:
    with pytest.raises(InputError, match="got frames 0 to 4, expected 0 to 3"):
        TRUTH.is_correct([0, 4], [0, 0])


@pytest.mark.parametrize(
    ("positives", "words"),
    [
        (np.array([0.0]), "got float64"),
        (np.array([[0]], np.int64), r"of shape \(1, 1\)"),
        (np.array([2, 1], np.int64), "query 1: expected rising"),
        (np.array([1, 1], np.int64), "query 1: expected rising"),
        (np.array([-1], np.int64), "got reference -1, expected indices from 0 below 4"),
        (np.array([4], np.int64), "got reference 4, expected indices from 0 below 4"),
    ],
)
def test_lists_that_are_refused(positives: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        GroundTruth((np.array([3], np.int64), positives), 4, "bad")


def test_bounded_drops_what_lies_past_the_map_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    unbounded = from_positives([[0], [3, 4, 5], [5]], description="overlong")
    assert unbounded.n_references is None
    with caplog.at_level(logging.WARNING):
        truth = unbounded.bounded(4)
    assert lists(truth) == [[0], [3], []]
    assert truth.n_dropped == 3
    assert truth.n_references == 4
    assert truth.description == "overlong; 3 positives past the last of 4 references dropped"
    assert "3 positives past" in caplog.text


def test_bounded_is_quiet_where_nothing_is_dropped(caplog: pytest.LogCaptureFixture) -> None:
    truth = from_positives([[0], [3]]).bounded(4)
    assert (truth.n_dropped, truth.n_references, caplog.text) == (0, 4, "")
    assert TRUTH.bounded(4) is TRUTH


def test_a_map_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="of 4 references, the map has 5"):
        TRUTH.bounded(5)
    with pytest.raises(InputError, match="of 4 references, the map has 3"):
        TRUTH.matrix(3)
    with pytest.raises(InputError, match="say n_references"):
        from_positives([[0]]).matrix()


def test_select_numbers_anew_and_removed_positives_disappear() -> None:
    truth = TRUTH.select([0, 1, 3], [1, 3])
    assert lists(truth) == [[0], [], [0, 1]]
    assert truth.n_references == 2
    assert truth.description == (
        "by hand; 3 of 4 queries and 2 of 4 references kept, 1 queries left without a true match"
    )


def test_select_follows_the_order_given() -> None:
    assert lists(TRUTH.select([3, 0], [3, 2, 1, 0])) == [[0, 2], [2, 3]]


def test_select_of_everything_is_the_same_truth() -> None:
    assert TRUTH.select() is TRUTH
    assert TRUTH.select(range(4), range(4)) is TRUTH


def test_select_of_one_side() -> None:
    assert lists(TRUTH.select(query_indices=[1])) == [[2]]
    assert lists(TRUTH.select(reference_indices=[2])) == [[], [0], [], []]
    empty = TRUTH.select([], [])
    assert (empty.n_queries, empty.n_references) == (0, 0)


def test_select_where_the_size_of_the_map_is_not_known() -> None:
    unbounded = from_positives([[0, 9], [2, 3]])
    assert lists(unbounded.select(None, [0, 3, 5])) == [[0], [1]]
    assert unbounded.select(None, [0, 3, 5]).n_references == 3
    assert unbounded.select([0, 1], range(4)).n_dropped == 1, "all of four frames"


def test_a_thinned_pair_keeps_the_tolerance_of_its_files() -> None:
    every_20th = np.arange(0, 3576, 20)
    full = aligned(3576, 3576, tolerance=20)
    thinned = full.select(every_20th, every_20th)
    assert lists(thinned) == lists(aligned(179, 179, tolerance=1))
    assert thinned.tolerance_frames == 20
    assert thinned.description == (
        "index-aligned, tolerance 20 frames; 179 of 3576 queries and 179 of 3576 references "
        "kept, 0 queries left without a true match; the tolerance counts the original frames"
    )


@pytest.mark.parametrize(
    ("queries", "references", "error", "words"),
    [
        ([0, 0], None, InputError, "query_indices: some frames are repeated"),
        ([4], None, InputError, "query_indices: got 4 to 4, expected frames from 0 to 3"),
        (None, [-1], InputError, "reference_indices: got -1 to -1"),
        (None, [0.5], ShapeError, "reference_indices: got float64"),
    ],
)
def test_select_of_frames_that_are_not_there(
    queries: list[int] | None, references: list[int] | None, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        TRUTH.select(queries, references)
