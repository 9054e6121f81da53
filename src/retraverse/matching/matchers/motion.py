"""How a camera is expected to move over the map: what filter and graph search share."""

import math

import numpy as np

from retraverse.kernels import Motion
from retraverse.types import IntArray

__all__ = ["motion_model", "moves_within"]

OTHER_MOVES = 0.05
"""Probability of all moves within reach other than 0, 1 and 2 frames, together."""


def moves_within(back: int, forward: int) -> IntArray:
    """Return the moves from -back to +forward, the nearest to the map's own speed first."""
    return np.array(sorted(range(-back, forward + 1), key=lambda move: abs(move - 1)), np.int64)


def motion_model(back: int, forward: int, *, jump: float, leave: float, enter: float) -> Motion:
    """Return the motion of a camera whose speed is anything from half to twice the map's.

    At speed v between 1/2 and 1 a frame moves 1 with probability v and 0 else; between 1 and 2 it
    moves 2 with probability v - 1 and 1 else. With log v spread evenly, the mean of v is 1 / (2 ln
    2) below 1 and 1 / ln 2 above, so that the moves 0, 1 and 2 have probabilities .14, .64 and .22.
    All other moves within reach share `OTHER_MOVES`; where 2 is out of reach it is left out.
    """
    slow, fast = 1 / (2 * math.log(2)), 1 / math.log(2) - 1
    usual = {0: (1 - slow) / 2, 1: (slow + 1 - fast) / 2, 2: fast / 2}
    moves = moves_within(back, forward)
    others = OTHER_MOVES / max(1, sum(move not in usual for move in moves.tolist()))
    weights = np.array([usual.get(move, others) for move in moves.tolist()])
    weights *= (1 - jump - leave) / weights.sum()
    return Motion(moves, weights.astype(np.float32), jump=jump, leave=leave, enter=enter)
