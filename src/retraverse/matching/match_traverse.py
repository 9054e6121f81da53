"""Matching a drive, or a ready similarity matrix, in windows of one length or of their own.

The mean of the diagonal has ways of its own: block by block, so that the matrix is never whole,
with dynamic lengths, and with the region of interest of a window's first frame. All other
matchers take the whole matrix of single frames, each under its own region of interest.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.images import Traverse
from retraverse.maps import RouteMap
from retraverse.matching.calibrated_length import Overlap, calibrated_windows, ensure_entropy
from retraverse.matching.checks import (
    check_lengths_fit,
    check_sequence_length,
    checked_similarity,
)
from retraverse.matching.dynamic_length import GrowthRule, Window, dynamic_windows
from retraverse.matching.matchers import Matcher
from retraverse.matching.matchers import matcher as matcher_of_name
from retraverse.matching.matches import Matches
from retraverse.matching.pairwise import (
    describe_query,
    has_descriptor,
    similarity,
    similarity_blocks,
)
from retraverse.matching.windows import match_diagonals, match_first_roi
from retraverse.techniques import Descriptions, RegionalTechnique
from retraverse.techniques.convsequential import ConvSequentialParameters
from retraverse.types import BoolArray, FloatArray, IntArray, Progress, no_progress

__all__ = ["SequenceLength", "match", "match_similarity", "match_windows", "query_windows"]

SequenceLength = int | Literal["dynamic"]
"""Frames in a window: 1 for single frames, K, or each window its own."""


def match(
    query: Traverse | Descriptions,
    route: RouteMap,
    *,
    sequence_length: SequenceLength = 10,
    matcher: str | Matcher = "mean",
    threshold: float | None = None,
    progress: Progress = no_progress,
) -> Matches:
    """Return where each window of query frames lies on the map (algorithms 1 to 5).

    Parameters
    ----------
    query : Traverse or Descriptions
        The drive to locate, or its descriptions by the map's technique.
    route : RouteMap
        The map; its technique describes the query.
    sequence_length : int or "dynamic"
        1 matches single frames; K windows of K frames; ``"dynamic"`` lets every window find its
        own length (sections 3.2.5 and 3.2.6), for the mean: by the published thresholds with
        convsequential, by thresholds calibrated on the map with any other technique.
    matcher : str or Matcher
        How the pairs become answers: a name of `matchers`, or a `matcher` with its parameters.
        ``"mean"`` is the thesis' own (equation 4.6).
    threshold : float, optional
        Windows that score below it are answered "no match" (reference -1).

    Raises
    ------
    InputError
        If a traverse is shorter than a window.
    ConfigError
        If the length is not offered by the matcher, or the matcher is unknown.

    Notes
    -----
    Static windows: N - K + 1 answers (equation 4.5). Dynamic windows stop when every frame has
    been read, so the last frames get none. Windows whose frames gave no descriptor at all are
    answered "no match". Peak memory is bounded by blocks: the (Q, R) matrix is never whole.

    That is the mean. Every other matcher takes the whole (Q, R) matrix, in which each query frame
    has its own region of interest, also where the technique says ``roi="first"``, and answers
    by its own rules; see there.
    """
    chosen = _chosen(matcher)
    queries = describe_query(query, route, progress=progress)
    if sequence_length == "dynamic":
        queries = ensure_entropy(queries, query, progress=progress)
    if chosen.name == "mean":
        lengths = query_windows(queries, route, sequence_length)
        (matches,) = match_windows(queries, route, [lengths], progress=progress)
    else:
        matches = _match_matrix(queries, route, sequence_length, chosen, progress)
    return matches if threshold is None else matches.refuse_below(threshold)


def match_windows(
    queries: Descriptions,
    route: RouteMap,
    choices: Sequence[IntArray],
    *,
    scores: FloatArray | None = None,
    progress: Progress = no_progress,
) -> tuple[Matches, ...]:
    """Return the mean's answers for several choices of windows, as `match` gives them one by one.

    Under the region of interest of a window's first frame all choices are answered in one pass, in
    which every pair of frames is compared once; otherwise `scores` serve all of them, or each
    choice compares anew, block by block.

    Parameters
    ----------
    queries : Descriptions
        By the map's technique.
    route : RouteMap
    choices : sequence of int64 arrays, each of a shape (W,)
        Lengths of the windows that start at query 0, 1, ... W-1: see `query_windows`.
    scores : float32 array, shape (Q, R), optional
        The similarity matrix, where it is there: what it answers is not compared again.
    progress : Progress
        Watches the comparing.

    Returns
    -------
    matches : tuple of Matches
        One for every choice.
    """
    found: dict[int, tuple[IntArray, FloatArray]] = {}
    for number, lengths in enumerate(choices):
        if not _needs_first_roi(route, lengths):
            blocks = [] if scores is None else [(0, scores)]
            rows = blocks or similarity_blocks(queries, route, progress=progress)
            found[number] = match_diagonals(rows, lengths)
    together = [number for number in range(len(choices)) if number not in found]
    if together:
        technique, chosen = route.technique, [choices[number] for number in together]
        assert isinstance(technique, RegionalTechnique)
        passed = match_first_roi(technique, queries, route, chosen, progress=progress)
        found.update(zip(together, passed, strict=True))
    described = has_descriptor(queries)
    return tuple(
        _matches(*found[number], lengths, len(queries), len(route)).refuse(
            ~_any_in_window(described, lengths)
        )
        for number, lengths in enumerate(choices)
    )


def _needs_first_roi(route: RouteMap, lengths: IntArray) -> bool:
    """Return whether a matrix, in which each frame has its own ROI, will not do."""
    return _takes_first_roi(route) and bool(lengths.max(initial=1) > 1)


def _match_matrix(
    queries: Descriptions,
    route: RouteMap,
    sequence_length: SequenceLength,
    chosen: Matcher,
    progress: Progress,
) -> Matches:
    """Return another matcher's answers from the whole matrix of single frames."""
    check_sequence_length(sequence_length)
    if sequence_length == "dynamic":
        raise ConfigError(
            f"sequence_length 'dynamic': the matcher {chosen.name} does not offer it; expected a "
            "whole number, or the matcher mean"
        )
    check_lengths_fit(len(queries), len(route), sequence_length)
    matches = chosen.match(similarity(queries, route, progress=progress), sequence_length)
    if not _takes_first_roi(route):
        return matches
    note = (
        f"The technique's roi is 'first', which only the matcher mean can follow: {chosen.name} "
        "took each frame's own region of interest."
    )
    return replace(matches, notes=(*matches.notes, note))


def match_similarity(
    similarity: FloatArray,
    *,
    sequence_length: int = 10,
    matcher: str | Matcher = "mean",
    threshold: float | None = None,
) -> Matches:
    """Return the same answers as `match` from a ready similarity matrix (algorithms 4 and 5).

    Parameters
    ----------
    similarity : float array, shape (Q, R)
        Rows are queries, columns references, higher is more alike; finite.
    sequence_length : int
        K: frames in a window.
    matcher : str or Matcher
        See `match`.
    threshold : float, optional
        Windows that score below it are answered "no match".

    Raises
    ------
    ShapeError
        If the matrix does not have two axes, or holds NaN or infinity.
    InputError
        If it has fewer rows or columns than K.
    ConfigError
        If K is not a whole number from 1, or the matcher is unknown.
    """
    chosen = _chosen(matcher)
    scores = checked_similarity(similarity)
    if str(sequence_length) == "dynamic":
        raise ConfigError(
            "sequence_length 'dynamic': a similarity matrix does not say how much the pictures "
            "hold; expected a whole number"
        )
    matches = chosen.match(scores, sequence_length)
    return matches if threshold is None else matches.refuse_below(threshold)


def query_windows(
    queries: Descriptions, route: RouteMap, sequence_length: SequenceLength
) -> IntArray:
    """Return int64 (W,): the lengths of the windows that start at query 0, 1, ... W-1.

    A dynamic window is never longer than the map.
    """
    check_sequence_length(sequence_length)
    if sequence_length == "dynamic":
        windows = _dynamic_windows(queries, route)
        lengths = np.array([window.length for window in windows], np.int64)
        return np.minimum(lengths, len(route))
    return _static_lengths(len(queries), len(route), int(sequence_length))


def _chosen(matcher: str | Matcher) -> Matcher:
    return matcher_of_name(matcher) if isinstance(matcher, str) else matcher


def _static_lengths(n_queries: int, n_references: int, sequence_length: int) -> IntArray:
    check_lengths_fit(n_queries, n_references, sequence_length)
    return np.full(n_queries - sequence_length + 1, sequence_length, np.int64)


def _dynamic_windows(queries: Descriptions, route: RouteMap) -> list[Window]:
    technique, parameters = route.technique, route.technique.parameters
    if not isinstance(parameters, ConvSequentialParameters):
        return calibrated_windows(queries, route)
    assert isinstance(technique, RegionalTechnique)
    rule = GrowthRule(
        sequence_entropy=parameters.sequence_entropy,
        information_threshold=parameters.information_threshold,
        min_length=parameters.min_sequence_length,
        max_overlap_length=parameters.max_overlap_length,
        max_length=parameters.max_sequence_length,
    )
    overlap = Overlap(technique, queries)
    return dynamic_windows(queries.arrays["entropy"], overlap, rule)


def _takes_first_roi(route: RouteMap) -> bool:
    return getattr(route.technique.parameters, "roi", "each") == "first"


def _any_in_window(frames: BoolArray, lengths: IntArray) -> BoolArray:
    """Return bool (W,): True where any frame of the window is True."""
    counts = np.concatenate([[0], np.cumsum(frames)])
    starts = np.arange(len(lengths))
    return np.asarray(counts[starts + lengths] > counts[starts])


def _matches(
    reference: IntArray,
    score: FloatArray,
    lengths: IntArray,
    n_queries: int,
    n_references: int,
) -> Matches:
    return Matches(
        query=np.arange(len(lengths)),
        reference=reference,
        score=score,
        sequence_length=lengths,
        n_queries=n_queries,
        n_references=n_references,
    )
