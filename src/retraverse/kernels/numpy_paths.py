"""NumPy twins of the compiled path kernels; they go row by row.

They take the same arguments and write into the same arrays; arguments have been checked by
`retraverse.kernels.paths`. `dtw`, `viterbi` and `graph` are bit for bit the same, `forward` and
`backward` up to the order of sums.
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.types import Array, FloatArray, IntArray

__all__ = ["backward", "dtw", "forward", "graph", "viterbi"]

DoubleArray = NDArray[np.float64]

DIAGONAL, SAME_REFERENCE, SAME_QUERY, START = range(4)
JUMPED, ENTERED = 254, 255
GRAPH_JUMPED, WAS_HIDDEN = 63, 128
NOWHERE = np.float32(-1e30)


def dtw(costs: FloatArray, quantum: float, open: bool, steps: Array) -> int:
    """Write how the cheapest path came to each cell; return the column where it ends."""
    shift = 1.5 * 2.0**52 * quantum
    value = np.zeros(0)
    for query, row in enumerate(costs):
        cost = (row.astype(np.float64) + shift) - shift
        if query == 0:
            value = cost if open else np.cumsum(cost)
            steps[0] = SAME_QUERY
            steps[0, : len(row) if open else 1] = START
            continue
        across = np.concatenate([[np.inf], value[:-1]])
        entering = np.minimum(across, value)
        steps[query] = np.where(across <= value, DIAGONAL, SAME_REFERENCE)
        # The best way along the row enters it somewhere and pays every cell from there: with
        # the costs' running sum that is one running minimum. All sums are exact.
        paid = np.cumsum(cost)
        value = paid + np.minimum.accumulate(entering - (paid - cost))
        steps[query, 1:][value[:-1] < entering[1:]] = SAME_QUERY
    return int(value.argmin()) if open else len(value) - 1


def viterbi(
    evidence: FloatArray,
    moves: IntArray,
    log_moves: FloatArray,
    jump: float,
    enter: float,
    leave: float,
    stay_outside: float,
    state: FloatArray,
    pointers: Array,
    peaks: IntArray,
    outside_from: IntArray,
    best: IntArray,
) -> None:
    """Advance the log scores of all states through rows of evidence."""
    n = evidence.shape[1]
    for i, row in enumerate(evidence):
        peak = peaks[i] = int(state[:n].argmax())
        jumping, entering = state[peak] + np.float32(jump), state[n] + np.float32(enter)
        value = np.full(n, max(jumping, entering), np.float32)
        code = pointers[i]
        code[:] = ENTERED if entering > jumping else JUMPED
        for how, (move, weight) in enumerate(zip(moves.tolist(), log_moves, strict=True)):
            to, start = _reach(move, n)
            _keep_better(state[start] + weight, how, value[to], code[to])
        staying = state[n] + np.float32(stay_outside)
        leaving = state[peak] + np.float32(leave)
        outside_from[i] = peak if leaving > staying else -1
        state[n] = max(staying, leaving)
        np.add(value, row, out=state[:n])
        best[i] = _settle(state)


def forward(
    likelihood: FloatArray,
    moves: IntArray,
    weights: FloatArray,
    jump: float,
    enter: float,
    leave: float,
    state: FloatArray,
    beliefs: FloatArray,
) -> None:
    """Advance the belief in all states through rows of likelihood."""
    n = likelihood.shape[1]
    for belief, row in zip(beliefs, likelihood, strict=True):
        inside, outside = float(state[:n].sum(dtype=np.float64)), float(state[n])
        belief[:n] = _spread(state[:n], moves, weights, (jump * inside + enter * outside) / n)
        belief[:n] *= row
        belief[n] = outside * (1 - enter) + inside * leave
        belief *= np.float32(1 / belief.sum(dtype=np.float64))
        state[:] = belief


def backward(
    likelihood: FloatArray,
    moves: IntArray,
    weights: FloatArray,
    jump: float,
    enter: float,
    leave: float,
    state: FloatArray,
    messages: FloatArray,
) -> None:
    """Take what later rows say of each state back through rows of likelihood."""
    n = likelihood.shape[1]
    for message, row in zip(messages[::-1], likelihood[::-1], strict=True):
        message[:] = state
        seen, outside = row * state[:n], float(state[n])
        mean = float(seen.mean(dtype=np.float64))
        state[:n] = _spread(seen, -moves, weights, jump * mean + leave * outside)
        state[n] = enter * mean + (1 - enter) * outside
        state *= np.float32(1 / state.sum(dtype=np.float64))


def graph(
    evidence: FloatArray,
    moves: IntArray,
    hidden: float,
    surface: float,
    jump: float,
    state: FloatArray,
    codes: Array,
    peaks: IntArray,
    best: IntArray,
) -> None:
    """Advance the scores of all matching and hidden nodes through rows of evidence."""
    n = evidence.shape[1]
    for i, row in enumerate(evidence):
        surfacing, surfaced = _choose(state, np.float32(surface))
        diving, dived = _choose(state, np.float32(0))
        peak = peaks[i] = int(diving.argmax())
        codes[i, 0] = 0
        codes[i, 1] = GRAPH_JUMPED | dived[peak]
        matched = np.full(n, NOWHERE)
        hid = np.full(n, diving[peak] - np.float32(jump), np.float32)
        for how, move in enumerate(moves.tolist()):
            to, start = _reach(move, n)
            _keep_better(surfacing[start], how | surfaced[start], matched[to], codes[i, 0, to])
            _keep_better(diving[start], how | dived[start], hid[to], codes[i, 1, to])
        np.add(matched, row, out=state[0])
        np.add(hid, np.float32(hidden), out=state[1])
        best[i] = int(state.argmax())
        state -= state.max()


def _reach(move: int, n: int) -> tuple[slice, slice]:
    """Return the columns that a move leads to, and those it comes from."""
    return slice(max(move, 0), n + min(move, 0)), slice(max(-move, 0), n - max(move, 0))


def _keep_better(offered: FloatArray, how: int | Array, value: FloatArray, code: Array) -> None:
    better = offered > value
    np.copyto(value, offered, where=better)
    np.copyto(code, np.asarray(how, np.uint8), where=better)


def _choose(state: FloatArray, toll: np.float32) -> tuple[FloatArray, Array]:
    """Return the better of matching and hidden per frame, and 128 where it was hidden."""
    from_hidden = state[1] - toll
    better = from_hidden > state[0]
    return np.where(better, from_hidden, state[0]), better.astype(np.uint8) * np.uint8(WAS_HIDDEN)


def _settle(state: FloatArray) -> int:
    """Subtract the maximum; return the best frame, or -1 for outside."""
    peak = int(state[:-1].argmax())
    outside = state[-1] >= state[peak]
    state -= state[-1] if outside else state[peak]
    return -1 if outside else peak


def _spread(
    source: FloatArray, moves: IntArray, weights: FloatArray, everywhere: float
) -> FloatArray:
    out = np.full(len(source), everywhere, np.float32)
    for move, weight in zip(moves.tolist(), weights, strict=True):
        to, start = _reach(move, len(source))
        out[to] += weight * source[start]
    return out
