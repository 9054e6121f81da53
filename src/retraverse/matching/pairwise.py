"""Similarity of every query frame with every frame of the map, block by block."""

from collections.abc import Iterator

import numpy as np

from retraverse.images import Traverse
from retraverse.maps import RouteMap, describe_traverse
from retraverse.techniques import Descriptions, Technique
from retraverse.types import FloatArray, Progress, no_progress

__all__ = ["describe_query", "has_descriptor", "similarity", "similarity_blocks"]

BLOCK_BYTES = 64 * 2**20
"""How much of the map is looked at in one go; bounds memory whatever the map's length."""
BLOCK_QUERIES = 256


def similarity(
    query: Traverse | Descriptions, route: RouteMap, *, progress: Progress = no_progress
) -> FloatArray:
    """Return how alike each query frame and each frame of the map are (algorithm 3).

    Parameters
    ----------
    query : Traverse or Descriptions
        The drive to locate, or its descriptions by the map's technique.
    route : RouteMap
        The map.
    progress : Progress
        Watches the describing and the comparing.

    Returns
    -------
    similarity : float32 array, shape (Q, R)
        Rows are queries, columns references, higher is more alike.
    """
    described = describe_query(query, route, progress=progress)
    scores = np.empty((len(described), len(route)), np.float32)
    for start, rows in similarity_blocks(described, route, progress=progress):
        scores[start : start + len(rows)] = rows
    return scores


def similarity_blocks(
    queries: Descriptions, route: RouteMap, *, progress: Progress = no_progress
) -> Iterator[tuple[int, FloatArray]]:
    """Yield the similarity matrix some rows at a time, as (first query, float32 (B, R)).

    A technique with ``compares_whole_drives`` gets both drives whole, and gives one block.
    """
    whole = getattr(route.technique, "compares_whole_drives", False)
    n_rows = max(1, len(queries)) if whole else BLOCK_QUERIES
    starts = range(0, len(queries), n_rows)
    for start in progress(starts, total=len(starts), label="matching"):
        block = queries[start : start + n_rows]
        rows = np.empty((len(block), len(route)), np.float32)
        parts = [(0, route.descriptions())] if whole else route.blocks(BLOCK_BYTES)
        for first, references in parts:
            rows[:, first : first + len(references)] = route.technique.similarity(block, references)
        yield start, rows


def describe_query(
    query: Traverse | Descriptions, route: RouteMap, *, progress: Progress = no_progress
) -> Descriptions:
    """Return the query described by the map's technique; descriptions pass through."""
    if isinstance(query, Descriptions):
        return query
    return _describe(query, route.technique, progress)


def has_descriptor(queries: Descriptions) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return bool (Q,): False where a frame gave no descriptor (all zeros, or none at all)."""
    descriptor = queries.descriptor
    return np.asarray(descriptor.reshape(len(descriptor), -1).any(axis=1))


def _describe(query: Traverse, technique: Technique, progress: Progress) -> Descriptions:
    described = describe_traverse(query, technique, progress=progress)
    return Descriptions.stack(described, technique.layout)
