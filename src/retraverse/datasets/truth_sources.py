"""Ground truth from files, aligned traverses, positions and lists.

Contents: `ground_truth` (the JSON of VPR-Bench's sets), `aligned` (traverses whose frames
correspond by index), `from_positions` (places within a radius), `from_positives` (lists).
"""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.truth_files import read_positives
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.types import Array, BoolArray, IntArray, Progress, no_progress

__all__ = ["aligned", "from_positions", "from_positives", "ground_truth"]

BLOCK_PAIRS = 1 << 20
"""Pairs of positions whose distances are held at once."""


def ground_truth(path: str | PathLike[str], *, n_references: int | None = None) -> GroundTruth:
    """Read ground truth from JSON: ``{"query index": [reference indices], ...}``.

    Parameters
    ----------
    path : path
        Every query from 0 must be there; ``[-1]`` or ``[]`` = truly no match. Order and repeated
        references do not matter.
    n_references : int, optional
        Frames of the map. References past its end, which published files have, are then dropped
        with a warning in the log and counted; otherwise `evaluate` does so.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If it is not such JSON; the message names the query.
    """
    truth = from_positives(read_positives(path), description=f"list in {Path(path).name}")
    return truth if n_references is None else truth.bounded(n_references)


def from_positives(
    positives: Sequence[ArrayLike],
    n_references: int | None = None,
    *,
    description: str = "listed positives",
) -> GroundTruth:
    """Make ground truth from one list of reference indices per query, in any order.

    Parameters
    ----------
    positives : sequence of int arrays
        References of each query; empty, or -1 alone, = truly no match.
    n_references : int, optional
        Frames of the map; indices past its end are dropped with a warning in the log and counted.
    description : str
        For reports.

    Raises
    ------
    InputError
        If an index is negative, other than -1 alone, or not a whole number.
    """
    listed = tuple(_rising(query, values) for query, values in enumerate(positives))
    truth = GroundTruth(listed, None, description)
    return truth if n_references is None else truth.bounded(n_references)


def aligned(
    n_queries: int, n_references: int, tolerance: int = 2, *, every: int = 1
) -> GroundTruth:
    """Make ground truth of traverses whose frames correspond: query i shows reference i.

    Parameters
    ----------
    n_queries, n_references : int
        Frames of both traverses. Queries beyond the references have truly no match.
    tolerance : int of at least 0
        References i - tolerance to i + tolerance are right. The thesis takes 2, and 1 for Nordland
        (section 3.4.1).
    every : int of at least 1
        If both traverses were thinned to every so many-th file, to say the tolerance in files too.

    Raises
    ------
    ConfigError
        If a number is outside its range.
    """
    for name, value, least in (
        ("n_queries", n_queries, 0),
        ("n_references", n_references, 0),
        ("tolerance", tolerance, 0),
        ("every", every, 1),
    ):
        if value < least:
            raise ConfigError(f"{name}: got {value}, expected an integer of at least {least}")
    frames = np.arange(n_references, dtype=np.int64)
    frames.flags.writeable = False  # every list below is a view of it
    positives = tuple(
        frames[max(0, query - tolerance) : query + tolerance + 1] for query in range(n_queries)
    )
    in_files = f" ({tolerance * every} files of the original)" if every > 1 else ""
    description = f"index-aligned, tolerance {tolerance} frames{in_files}"
    return GroundTruth(positives, n_references, description, tolerance_frames=tolerance)


def from_positions(
    query_positions: ArrayLike,
    reference_positions: ArrayLike,
    radius_m: float = 25.0,
    *,
    progress: Progress = no_progress,
) -> GroundTruth:
    """Make ground truth of frames whose places are known: right within `radius_m`, inclusive.

    Parameters
    ----------
    query_positions : float array, shape (Q,), (Q, 2) or (Q, 3)
        In metres along the route, on the map (such as UTM), or in space. Not degrees.
    reference_positions : float array, shape (R,), (R, 2) or (R, 3)
        In the same frame.
    radius_m : float of at least 0
        25 m is the custom of the large street sets.
    progress : Progress
        Shows blocks of queries.

    Raises
    ------
    ShapeError
        If the shapes are not these, or differ in their second axis.
    InputError
        If a position is not finite.
    ConfigError
        If the radius is negative or no number.
    """
    queries = _positions(query_positions, "query_positions")
    references = _positions(reference_positions, "reference_positions")
    if queries.shape[1] != references.shape[1]:
        raise ShapeError(
            f"positions: queries have {queries.shape[1]} coordinates, references "
            f"{references.shape[1]}; expected the same"
        )
    if not (radius_m >= 0 and np.isfinite(radius_m)):
        raise ConfigError(f"radius_m: got {radius_m}, expected metres of at least 0")
    step = max(1, BLOCK_PAIRS // max(1, len(references)))
    starts = range(0, len(queries), step)
    positives: list[IntArray] = []
    for start in progress(starts, total=len(starts), label="ground truth"):
        near = _near(queries[start : start + step], references, radius_m)
        positives.extend(np.flatnonzero(row) for row in near)
    return GroundTruth(tuple(positives), len(references), f"positions within {radius_m:g} m")


def _near(queries: Array, references: Array, radius_m: float) -> BoolArray:
    """Whether each pair of (Q, D) and (R, D) lies within the radius: bool (Q, R)."""
    squared = np.zeros((len(queries), len(references)))
    for query_axis, reference_axis in zip(queries.T, references.T, strict=True):
        squared += (query_axis[:, None] - reference_axis) ** 2
    near: BoolArray = np.sqrt(squared) <= radius_m
    return near


def _positions(values: ArrayLike, name: str) -> Array:
    """Return finite float64 positions of two axes, or raise."""
    positions = np.asarray(values, np.float64)
    if positions.ndim == 1:
        positions = positions[:, None]
    if positions.ndim != 2 or positions.shape[1] not in (1, 2, 3):
        raise ShapeError(
            f"{name}: got shape {np.shape(values)}, expected (N,), (N, 2) or (N, 3) in metres"
        )
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        raise InputError(f"{name}: frame {int(finite.argmin())} has a position that is not finite")
    return positions


def _rising(query: int, values: ArrayLike) -> IntArray:
    """Return the positives of one query sorted, each once; -1 alone gives none."""
    listed = np.asarray(values)
    if listed.size == 0:
        return np.empty(0, np.int64)
    if listed.dtype.kind not in "iu" or listed.ndim != 1:
        raise InputError(
            f"positives of query {query}: got {listed.dtype} of shape {listed.shape}, "
            "expected a list of whole numbers"
        )
    unique = np.unique(listed).astype(np.int64)
    if unique[0] >= 0:
        return unique
    if unique[0] < -1 or unique.size > 1:
        raise InputError(
            f"positives of query {query}: got {unique[0]} among {listed.size}, "
            "expected references from 0, or -1 alone for no match"
        )
    return np.empty(0, np.int64)
