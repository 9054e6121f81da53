"""Paths through a similarity matrix: warping, hidden Markov models, graph search.

Conventions: rows are queries, columns references. The Markov and graph kernels go on from a
state they are given and change it, so that a drive may come in blocks of rows or row by row with
the same result. What the codes in their answers mean is said at each function.

Contents: `dtw_steps`; `Motion` with `viterbi`, `forward`, `backward`; `graph`.

Sources: Sakoe and Chiba, Dynamic programming algorithm optimization for spoken word recognition,
IEEE TASSP 1978; Rabiner, A tutorial on hidden Markov models, Proc. IEEE 1989; Vysotska and
Stachniss, Lazy data association for image sequences matching under substantial appearance
changes, IEEE RA-L 2016.
"""

import math
from dataclasses import dataclass
from types import ModuleType
from typing import NamedTuple

import numpy as np

from retraverse.errors import ConfigError, ShapeError
from retraverse.kernels import numpy_paths
from retraverse.kernels.backend import native
from retraverse.types import Array, FloatArray, IntArray

__all__ = [
    "GraphRows",
    "Motion",
    "ViterbiRows",
    "backward",
    "dtw_steps",
    "forward",
    "graph",
    "viterbi",
]

MOST_MOVES = 62
"""Moves a kernel can tell apart in a byte."""


@dataclass(frozen=True)
class Motion:
    """How a camera moves over the map from one frame to the next.

    The probabilities of the moves, of a jump and of leaving sum to 1.
    """

    moves: IntArray
    """int64 (M,): frames of the map moved, the likeliest first; at most 62 of them."""
    weights: FloatArray
    """float32 (M,): probability of each."""
    jump: float
    """Probability of going on at any frame of the map, all alike."""
    leave: float
    """Probability of leaving the map."""
    enter: float
    """Probability, outside, of entering the map at any frame, all alike."""


class ViterbiRows(NamedTuple):
    """How the likeliest path came to each state, for B rows and R frames of the map."""

    pointers: Array
    """uint8 (B, R): index of the move that led to a frame; 254 jumped, 255 entered."""
    peaks: IntArray
    """int64 (B,): the frame that jumps came from."""
    outside_from: IntArray
    """int64 (B,): the frame the map was left from; -1 if it was outside already."""
    best: IntArray
    """int64 (B,): the frame where the likeliest path so far ends; -1 = outside."""


class GraphRows(NamedTuple):
    """How the best path came to each node, for B rows and R frames of the map."""

    codes: Array
    """uint8 (B, 2, R), matching nodes and hidden ones: bit 7 says that the path came from a hidden
    node, the low six bits give the index of the move; 63 jumped."""
    peaks: IntArray
    """int64 (B,): the frame that jumps came from."""
    best: IntArray
    """int64 (B,): where the best path so far ends: the frame, R more where hidden."""


def dtw_steps(costs: FloatArray, *, open: bool) -> tuple[Array, int]:
    """Return how the cheapest warping path came to each cell, and the reference where it ends.

    Parameters
    ----------
    costs : float32 array, shape (Q, R), Q and R at least 1
        Finite costs from 0.
    open : bool
        True: the path begins and ends at any reference. False: it runs from the first to the last.

    Returns
    -------
    steps : uint8 array, shape (Q, R)
        0 from (q-1, r-1), 1 from (q-1, r), 2 from (q, r-1), 3 the path starts here.
    end : int
        Reference of the last query on the path; the lowest of equals.

    Notes
    -----
    Costs count in multiples of a power of two, below 1e-9 of the largest for any two traverses of
    less than a million frames together, so that equal paths tie exactly.
    """
    _check_matrix(costs)
    steps = np.empty(costs.shape, np.uint8)
    largest = float(costs.max())
    _, exponent = math.frexp(max(largest, 1e-30) * 2 * sum(costs.shape))
    end = _kernels().dtw(costs, math.ldexp(1.0, exponent - 52), open, steps)
    return steps, int(end)


def viterbi(evidence: FloatArray, motion: Motion, state: FloatArray) -> ViterbiRows:
    """Advance the likeliest paths through rows of evidence.

    Parameters
    ----------
    evidence : float32 array, shape (B, R)
        Log likelihood of each frame of the map, less that of being outside.
    motion : Motion
        Probabilities of what happens before each row.
    state : float32 array, shape (R + 1,)
        Log scores of the map's frames and of outside before the rows; becomes those after them,
        the best being 0.
    """
    n_rows, n = _check_matrix(evidence)
    _check_state(state, (n + 1,))
    _check_motion(motion)
    rows = ViterbiRows(
        np.empty((n_rows, n), np.uint8), *(np.empty(n_rows, np.int64) for _ in range(3))
    )
    with np.errstate(divide="ignore"):
        logs = np.log(np.array([motion.jump / n, motion.enter / n, motion.leave, 1 - motion.enter]))
        log_moves = np.log(motion.weights)
    _kernels().viterbi(evidence, motion.moves, log_moves, *logs.tolist(), state, *rows)
    return rows


def forward(likelihood: FloatArray, motion: Motion, state: FloatArray) -> FloatArray:
    """Return what is believed after each row: float32 (B, R + 1), every row summing to 1.

    Parameters
    ----------
    likelihood : float32 array, shape (B, R)
        Of each frame of the map, relative to being outside; positive.
    motion : Motion
        Probabilities of what happens before each row.
    state : float32 array, shape (R + 1,)
        Belief before the rows; becomes the one after them.
    """
    return _beliefs("forward", likelihood, motion, state)


def backward(likelihood: FloatArray, motion: Motion, state: FloatArray) -> FloatArray:
    """Return what the rows after each row say of the states there: float32 (B, R + 1).

    Times the belief of `forward` it gives what is believed knowing the whole drive. Parameters
    are those of `forward`; `state` is the message after the last row, all alike at the end of a
    drive, and becomes the one before the first row.
    """
    return _beliefs("backward", likelihood, motion, state)


def graph(
    evidence: FloatArray,
    moves: IntArray,
    state: FloatArray,
    *,
    hidden: float,
    surface: float,
    jump: float,
) -> GraphRows:
    """Advance the best paths through matching and hidden nodes.

    Parameters
    ----------
    evidence : float32 array, shape (B, R)
        What each matching node is worth.
    moves : int64 array, shape (M,)
        Frames of the map an edge may lead on; of equal paths the earliest in this list wins.
    state : float32 array, shape (2, R)
        Worth of the best paths to matching and hidden nodes before the rows; becomes that after
        them, the best being 0.
    hidden : float
        What a hidden node is worth.
    surface, jump : float
        What it costs to go from a hidden node to a matching one, and on to a hidden one anywhere.
    """
    n_rows, n = _check_matrix(evidence)
    _check_state(state, (2, n))
    _check_moves(moves)
    rows = GraphRows(
        np.empty((n_rows, 2, n), np.uint8), *(np.empty(n_rows, np.int64) for _ in range(2))
    )
    _kernels().graph(evidence, moves, hidden, surface, jump, state, *rows)
    return rows


def _beliefs(name: str, likelihood: FloatArray, motion: Motion, state: FloatArray) -> FloatArray:
    n_rows, n = _check_matrix(likelihood)
    _check_state(state, (n + 1,))
    _check_motion(motion)
    out = np.empty((n_rows, n + 1), np.float32)
    getattr(_kernels(), name)(
        likelihood,
        motion.moves,
        motion.weights,
        motion.jump,
        motion.enter,
        motion.leave,
        state,
        out,
    )
    return out


def _kernels() -> ModuleType:
    return native() or numpy_paths


def _check_matrix(matrix: FloatArray) -> tuple[int, int]:
    if matrix.ndim != 2 or matrix.dtype != np.float32 or not matrix.flags.c_contiguous:
        raise ShapeError(
            f"matrix: got {matrix.dtype} of shape {matrix.shape}, expected contiguous float32 "
            "of shape (queries, references)"
        )
    n_rows, n = matrix.shape
    if n == 0 or n_rows == 0:
        raise ShapeError(f"matrix: got shape {matrix.shape}, expected at least one row and column")
    return n_rows, n


def _check_state(state: FloatArray, shape: tuple[int, ...]) -> None:
    if state.shape != shape or state.dtype != np.float32 or not state.flags.c_contiguous:
        raise ShapeError(
            f"state: got {state.dtype} of shape {state.shape}, expected contiguous float32 {shape}"
        )


def _check_moves(moves: IntArray) -> None:
    if moves.ndim != 1 or moves.dtype != np.int64 or len(moves) > MOST_MOVES:
        raise ShapeError(
            f"moves: got {moves.dtype} of shape {moves.shape}, expected up to {MOST_MOVES} int64"
        )


def _check_motion(motion: Motion) -> None:
    _check_moves(motion.moves)
    if motion.weights.shape != motion.moves.shape or motion.weights.dtype != np.float32:
        raise ShapeError(
            f"weights: got {motion.weights.dtype} of shape {motion.weights.shape}, expected "
            f"float32 {motion.moves.shape}, one for each move"
        )
    total = float(motion.weights.sum()) + motion.jump + motion.leave
    if not math.isclose(total, 1, abs_tol=1e-4):
        raise ConfigError(f"motion: its probabilities sum to {total:g}, expected 1")
