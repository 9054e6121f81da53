"""When a window of query frames is long enough (thesis, sections 3.2.5 and 3.2.6).

A window grows while its newest frame still looks like its first (no information gained), and
while its pictures hold little entropy (no information seen). Equation 3.2 as printed would grow
it while the two frames *differ*; the authors' program, whose results are the published ones,
does the opposite, and so do we. It also starts at K = 2, so that K = 1 occurs only on the last
frame of a traverse.

The letters are the program's: k the length so far, n frames read, H their summed entropy.
"""

from collections.abc import Callable
from dataclasses import dataclass

from retraverse.types import Array

__all__ = ["GrowthRule", "Window", "dynamic_windows"]


@dataclass(frozen=True)
class GrowthRule:
    """Thresholds of growth (section 3.3.3)."""

    sequence_entropy: float = 0.5
    """ET: a window grows while its mean entropy is at most this."""
    information_threshold: float = 0.9
    """IT: a window grows while its newest frame is at least this similar to its first."""
    min_length: int = 1
    """min_K: at least so many frames are read."""
    max_overlap_length: int = 15
    """max_K_IG: similarity alone grows no further."""
    max_length: int = 25
    """max_K: no window is longer."""


@dataclass(frozen=True)
class Window:
    """One window of consecutive query frames."""

    start: int
    """Its first query frame."""
    length: int
    """Its frames, K."""
    sequential_entropy: float
    """Mean entropy of the frames read for it, in [0, 1] (equation 3.5)."""


def dynamic_windows(
    entropy: Array, overlap: Callable[[int, int], float], rule: GrowthRule
) -> list[Window]:
    """Return the windows of a traverse, one from each frame until every frame has been read.

    The frames after the last window's start begin none: the authors' program stops when it has
    read the whole traverse, so its tail gets no answer.

    Parameters
    ----------
    entropy : float array, shape (N,)
        Entropy of every query picture, in [0, 1].
    overlap : callable
        ``overlap(first, later)``: similarity of two query frames under the first one's ROI.
    rule : GrowthRule
        The thresholds.
    """
    windows: list[Window] = []
    n_seen = 0
    for start in range(len(entropy)):
        if n_seen == len(entropy):
            break
        window, n_read = _grow(start, n_seen, entropy, overlap, rule)
        n_seen = max(n_seen, start + n_read)
        windows.append(window)
    return windows


def _grow(
    start: int,
    n_seen: int,
    entropy: Array,
    overlap: Callable[[int, int], float],
    rule: GrowthRule,
) -> tuple[Window, int]:
    """Return the window that begins at `start`, and how many frames were read for it."""
    k, n, H, mean_entropy, done = rule.min_length + 1, 0, 0.0, 0.0, False
    while (
        n_seen < len(entropy)
        and (mean_entropy <= rule.sequence_entropy or n < rule.min_length or not done)
        and n < rule.max_length
    ):
        frame = start + n
        n += 1
        n_seen = max(n_seen, frame + 1)
        H += float(entropy[frame])
        mean_entropy = H / n
        if n > 1:
            if overlap(start, frame) >= rule.information_threshold and k < rule.max_overlap_length:
                k += 1
            else:
                done = True
        low = mean_entropy <= rule.sequence_entropy
        if low and done and k < rule.max_length and n >= rule.min_length:
            k += 1
    return Window(start, min(k, n), mean_entropy), n
