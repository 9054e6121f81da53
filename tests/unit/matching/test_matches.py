"""Which reference each query frame belongs to, from the answers of windows."""

from typing import Any

import numpy as np

from retraverse.matching import Matches


def windows(
    query: list[int], reference: list[int], length: int | list[int], n_queries: int, **more: Any
) -> Matches:
    return Matches(
        query=np.array(query, np.int64),
        reference=np.array(reference, np.int64),
        score=np.arange(len(query), dtype=np.float32),
        sequence_length=np.broadcast_to(np.array(length, np.int64), len(query)).copy(),
        n_queries=n_queries,
        n_references=10,
        **more,
    )


def test_a_frame_belongs_to_the_window_it_starts_and_the_tail_follows_the_last() -> None:
    matches = windows([0, 1, 2], [4, 7, 5], 3, 5)
    assert matches.frame_reference.tolist() == [4, 7, 5, 6, 7]
    frames = matches.by_frame()
    assert frames.query.tolist() == [0, 1, 2, 3, 4]
    assert frames.score.tolist() == [0, 1, 2, 2, 2]
    assert frames.sequence_length.tolist() == [3] * 5
    assert frames.n_unanswered == 0


def test_no_window_reaches_past_its_length_or_the_map() -> None:
    assert windows([0, 1], [4, 5], [3, 2], 5).frame_reference.tolist() == [4, 5, 6, -1, -1]
    assert windows([0], [8], 4, 4).frame_reference.tolist() == [8, 9, -1, -1]
    assert windows([2], [3], 2, 4).frame_reference.tolist() == [-1, -1, 3, 4]


def test_refused_windows_leave_their_frames_without_a_place() -> None:
    matches = windows([0, 1, 2], [4, 5, 6], 2, 4)
    refused = matches.refuse(np.array([False, True, False]))
    assert refused.frame_reference.tolist() == [4, -1, 6, 7]
    assert matches.refuse_below(2.5).frame_reference.tolist() == [-1] * 4


def test_trajectories_say_where_each_frame_is() -> None:
    matches = windows([1, 2], [3, 4], 3, 4, followed=np.array([2, 3, 4, 6]))
    assert matches.frame_reference.tolist() == [2, 3, 4, 6]
    assert matches.by_frame().reference.tolist() == [2, 3, 4, 6]
    assert matches.by_frame().score.tolist() == [0, 0, 1, 1]
    assert matches.refuse(np.array([True, False])).frame_reference.tolist() == [-1, -1, 4, 6]


def test_diagonals_are_told_from_lines_and_paths() -> None:
    assert windows([0, 1], [4, 5], 3, 4).are_diagonals
    assert not windows([0, 1], [4, 5], 3, 3).are_diagonals
    assert not windows([1, 2], [3, 4], 2, 4, followed=np.array([2, 3, 4, 6])).are_diagonals


def test_frames_of_frames_are_the_same_frames() -> None:
    once = windows([0, 1], [4, 5], 3, 6).by_frame()
    np.testing.assert_array_equal(once.by_frame().reference, once.reference)
    assert once.refuse(once.reference == 5).frame_reference.tolist() == [4, -1, 6, 7, -1, -1]


def test_no_windows_no_places() -> None:
    frames = windows([], [], 1, 3).by_frame()
    assert frames.reference.tolist() == [-1] * 3
    assert frames.score.tolist() == [0] * 3


def test_notes_stay_with_the_answers() -> None:
    matches = windows([0], [1], 1, 1, notes=("a remark",))
    assert matches.refuse(np.array([True])).notes == ("a remark",)
    assert matches.by_frame().notes == ("a remark",)
