"""The best place in the map for each window of query frames.

A window's score at reference r is the mean of its K pairs (query + t, r + t), t = 0..K-1
(algorithms 2, 4 and 5; equation 4.6): the mean of a diagonal of the similarity matrix. Two ways
lead there, both in one pass over the query and in memory that does not grow with it:

`match_diagonals`
    Every pair has one score, so one similarity matrix serves windows of every length.
`match_first_roi`
    Every pair is scored under the region of interest of its *window's first* frame, as the
    authors' program does, so a pair has one score per window. The regions' best matches do not
    depend on the ROI, so all windows that share a frame are scored together. A shorter window
    is the beginning of a longer one, so one pass serves windows of many lengths.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from retraverse import kernels
from retraverse.maps import RouteMap
from retraverse.matching.pairwise import BLOCK_BYTES
from retraverse.techniques import Descriptions, RegionalTechnique
from retraverse.types import Array, FloatArray, IntArray, Progress, no_progress

__all__ = ["match_diagonals", "match_first_roi"]


def match_diagonals(
    blocks: Iterable[tuple[int, FloatArray]], lengths: IntArray
) -> tuple[IntArray, FloatArray]:
    """Return the best reference and its score for every window, from rows of similarity.

    Parameters
    ----------
    blocks : iterable of (int, float32 array of shape (B, R))
        The similarity matrix some rows at a time, in order, each with its first query.
    lengths : int64 array, shape (W,)
        Frames in the window that starts at query 0, 1, ... W-1.

    Returns
    -------
    reference : int64 array, shape (W,)
        First reference of the best diagonal; the lowest of equals.
    score : float32 array, shape (W,)
        Its mean similarity.
    """
    reference = np.empty(len(lengths), np.int64)
    score = np.empty(len(lengths), np.float32)
    complete_at = np.maximum.accumulate(np.arange(len(lengths)) + lengths)
    answered, kept = 0, None
    for start, rows in blocks:
        kept = rows if kept is None or not len(kept) else np.concatenate([kept, rows])
        ready = int(np.searchsorted(complete_at, start + len(rows), side="right"))
        if ready > answered:
            reference[answered:ready], score[answered:ready] = kernels.best_diagonals_variable(
                kept, lengths[answered:ready]
            )
            kept = kept[ready - answered :]
            answered = ready
    return reference, score


def match_first_roi(
    technique: RegionalTechnique,
    queries: Descriptions,
    route: RouteMap,
    choices: Sequence[IntArray],
    *,
    progress: Progress = no_progress,
) -> list[tuple[IntArray, FloatArray]]:
    """Return the best reference and its score for every window, each under its first frame's ROI.

    Parameters
    ----------
    technique : RegionalTechnique
    queries : Descriptions
    route : RouteMap
    choices : sequence of int64 arrays, each of a shape (W,)
        Lengths, as `match_diagonals` takes them; several choices of windows cost little more than
        their longest.
    progress : Progress
        Watches the query frames.

    Returns
    -------
    found : list of (int64 array, float32 array), each of shape (W,)
        For every choice what `match_diagonals` returns.

    Notes
    -----
    Memory beside the descriptions: the sums of the windows that are open, K R numbers for a
    longest window of K frames, whatever the query's length. The last digit of a score may depend on
    the other choices: the regions of all open windows are added up in one order.
    """
    longest = _longest(choices)
    weights = technique.region_weights(queries[: len(longest)])
    found = [(np.empty(len(one), np.int64), np.empty(len(one), np.float32)) for one in choices]
    asked = _asked(choices)
    sums: dict[int, Array] = {}
    n_frames = int((np.arange(len(longest)) + longest).max(initial=0))
    for frame in progress(range(n_frames), total=n_frames, label="matching"):
        if frame < len(longest):
            sums[frame] = np.zeros(len(route))
        windows = sorted(sums)
        pairs = _frame_scores(technique, queries.descriptor[frame], route, weights[windows])
        for window, pair_scores in zip(windows, pairs, strict=True):
            offset = frame - window
            # The window's pair number `offset` puts reference r + offset beside start r.
            starts = sums[window][: len(route) - offset]
            starts += pair_scores[offset:]
            for choice in asked.get((window, offset + 1), ()):
                reference, score = found[choice]
                reference[window], score[window] = _best(starts / (offset + 1))
            if offset + 1 == longest[window]:
                del sums[window]
    return found


def _longest(choices: Sequence[IntArray]) -> IntArray:
    """Return int64 (W,): the most frames that any choice gives the window at query 0, 1, ..."""
    longest = np.zeros(max(map(len, choices), default=0), np.int64)
    for lengths in choices:
        longest[: len(lengths)] = np.maximum(longest[: len(lengths)], lengths)
    return longest


def _asked(choices: Sequence[IntArray]) -> dict[tuple[int, int], list[int]]:
    """Return the choices that have a window of this (start, length)."""
    asked: dict[tuple[int, int], list[int]] = {}
    for choice, lengths in enumerate(choices):
        for window, length in enumerate(lengths.tolist()):
            asked.setdefault((window, length), []).append(choice)
    return asked


def _frame_scores(
    technique: RegionalTechnique, query: Array, route: RouteMap, weights: FloatArray
) -> FloatArray:
    """Return float32 (M, R): one query frame against the whole map under M weightings."""
    scores = np.empty((len(weights), len(route)), np.float32)
    for first, references in route.blocks(BLOCK_BYTES):
        scores[:, first : first + len(references)] = technique.weighted_similarity(
            query, references.descriptor, weights
        )
    return scores


def _best(means: Array) -> tuple[int, np.float32]:
    """Return the first index of the largest mean, compared as float32 so that equals tie."""
    rounded = means.astype(np.float32)
    index = int(np.argmax(rounded))
    return index, rounded[index]
