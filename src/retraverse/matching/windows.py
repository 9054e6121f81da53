"""The best place in the map for each window of query frames.

A window's score at reference r is the mean of its K pairs (query + t, r + t), t = 0..K-1
(algorithms 2, 4 and 5; equation 4.6): the mean of a diagonal of the similarity matrix. Two ways
lead there, both in one pass over the query and in memory that does not grow with it:

`match_diagonals`
    Every pair has one score, so one similarity matrix serves windows of every length.
`match_first_roi`
    Every pair is scored under the region of interest of its *window's first* frame, as the
    authors' program does, so a pair has one score per window. The regions' best matches do not
    depend on the ROI, so all windows that share a frame are scored together.
"""

from collections.abc import Iterable

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
    lengths: IntArray,
    *,
    progress: Progress = no_progress,
) -> tuple[IntArray, FloatArray]:
    """Return the best reference and its score for every window, each under its first frame's ROI.

    Parameters and results are those of `match_diagonals`, with descriptions for blocks.
    """
    weights = technique.region_weights(queries[: len(lengths)])
    reference = np.empty(len(lengths), np.int64)
    score = np.empty(len(lengths), np.float32)
    sums: dict[int, Array] = {}
    n_frames = int((np.arange(len(lengths)) + lengths).max(initial=0))
    frames = progress(range(n_frames), total=n_frames, label="matching")
    for frame in frames:
        if frame < len(lengths):
            sums[frame] = np.zeros(len(route))
        windows = sorted(sums)
        pairs = _frame_scores(technique, queries.descriptor[frame], route, weights[windows])
        for window, pair_scores in zip(windows, pairs, strict=True):
            offset = frame - window
            # The window's pair number `offset` puts reference r + offset beside start r.
            sums[window][: len(route) - offset] += pair_scores[offset:]
            if offset + 1 == lengths[window]:
                means = sums.pop(window)[: len(route) - offset] / lengths[window]
                reference[window], score[window] = _best(means)
    return reference, score


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
