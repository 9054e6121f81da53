"""The mean's answers of a study task: all lengths of it together, and what a window costs.

Under the region of interest of a window's first frame every length would compare all pairs of
frames anew; here one pass serves all of them, and the similarity matrix serves what it can.

What a window costs does not change by that: K rows of similarity, each under one region of
interest, are counted by the caller from the time a row of the matrix took. To it comes, as
`Answers.window_s`, finding the window's length and the best mean of K rows.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from retraverse.maps import RouteMap
from retraverse.matching import Matches, SequenceLength
from retraverse.matching.match_traverse import match_windows, query_windows
from retraverse.matching.windows import match_diagonals
from retraverse.techniques import Descriptions
from retraverse.types import FloatArray, IntArray

__all__ = ["Answers", "answer_windows", "timed_answers"]


@dataclass(frozen=True)
class Answers:
    """Answers of one run."""

    matches: Matches
    window_s: float
    """Seconds that one window took, the similarity of its frames not counted."""


def timed_answers(find: Callable[[], Matches]) -> Answers:
    """Return what `find` returns, with its seconds a window."""
    began = time.perf_counter()
    matches = find()
    return Answers(matches, (time.perf_counter() - began) / max(1, len(matches)))


def answer_windows(
    queries: Descriptions,
    route: RouteMap,
    scores: FloatArray,
    sequence_lengths: Iterable[SequenceLength],
    *,
    lengths_by: Descriptions,
) -> dict[SequenceLength, Answers | Exception]:
    """Return the mean's answers for several lengths, as `match` gives them one by one.

    Parameters
    ----------
    queries : Descriptions
        As they are compared with the map.
    route : RouteMap
    scores : float32 array, shape (Q, R)
        The similarity matrix of single frames.
    sequence_lengths : iterable of int or "dynamic"
    lengths_by : Descriptions
        The query's as it was described, with entropy, where a length is "dynamic": who drives
        knows how much changes from frame to frame, whatever becomes of it on the way.

    Returns
    -------
    answers : dict
        For every length its answers, or why it has none: a length that cannot be answered does
        not spoil the others.
    """
    windows: dict[SequenceLength, tuple[IntArray, float]] = {}
    refused: dict[SequenceLength, Exception] = {}
    for length in sequence_lengths:
        try:
            windows[length] = _timed_windows(lengths_by, route, scores, length)
        except Exception as error:
            refused[length] = error
    choices = [lengths for lengths, _ in windows.values()]
    found = match_windows(queries, route, choices, scores=scores)
    answered = {
        length: Answers(matches, window_s)
        for matches, (length, (_, window_s)) in zip(found, windows.items(), strict=True)
    }
    return {**answered, **refused}


def _timed_windows(
    queries: Descriptions, route: RouteMap, scores: FloatArray, length: SequenceLength
) -> tuple[IntArray, float]:
    """Return the lengths of all windows, and the seconds one takes beside its similarities.

    The means are timed on the matrix: adding up takes the same under any region of interest.
    """
    began = time.perf_counter()
    lengths = query_windows(queries, route, length)
    match_diagonals([(0, scores)], lengths)
    return lengths, (time.perf_counter() - began) / max(1, len(lengths))
