"""Standing still: how much the picture changes along a drive, and the drive without its stops.

Motion between two pictures is the mean absolute difference of their 64x32 grey thumbnails,
smoothed over 3x3 and brought to mean 0 and standard deviation 1. Averaging takes the noise of the
camera away, the normalisation takes the light away. Measured on three public drives: neighbours of
a moving camera differ by 0.055 or more (median 0.16 to 0.6), two pictures of one view with noise
of 5 grey levels by 0.002 to 0.03, after JPEG of quality 50 by 0.002 to 0.02, at 0.8 times the
light by 0.002 to 0.004. Pictures that are only 64x32 to begin with keep their noise: 0.03 to 0.2
at the same noise.
"""

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from retraverse.errors import ConfigError
from retraverse.images.frame import Frame
from retraverse.images.traverse import Traverse
from retraverse.types import FloatArray, ImageArray, Progress, no_progress

__all__ = ["MIN_MOTION", "measure_motion", "without_stops"]

MIN_MOTION = 0.05
"""Above what noise and compression do to a standing camera, below what a moving one sees."""
THUMBNAIL = (64, 32)
MIN_CONTRAST = 10.0
"""Grey levels. A picture flatter than this is not stretched: its noise would look like motion."""


def measure_motion(traverse: Traverse, *, progress: Progress = no_progress) -> NDArray[np.float64]:
    """Return how much each picture differs from the one before it.

    Parameters
    ----------
    traverse : Traverse
    progress : Progress
        Shows the frames.

    Returns
    -------
    motion : float64 array, shape (N - 1,)
        Mean absolute difference of normalised thumbnails, in standard deviations, from 0.

    Raises
    ------
    FrameReadError
        If a picture cannot be read.
    """
    frames = progress(traverse, total=len(traverse), label=f"motion of {traverse.name}")
    thumbnails = (_thumbnail(frame) for frame in frames)
    return np.array([_motion(a, b) for a, b in itertools.pairwise(thumbnails)], np.float64)


def without_stops(
    traverse: Traverse, min_motion: float = MIN_MOTION, *, progress: Progress = no_progress
) -> Traverse:
    """Return the traverse without frames that hardly differ from the last one kept.

    The first frame is kept, then each that differs by at least `min_motion` from the last one
    kept, so that slow motion adds up until it counts.

    Parameters
    ----------
    traverse : Traverse
    min_motion : float of at least 0
        See `measure_motion`; 0 keeps every frame.
    progress : Progress
        Shows the frames.

    Returns
    -------
    moving : Traverse
        Its frames keep their `index`, which truth is selected by.

    Raises
    ------
    ConfigError
        If `min_motion` is negative or no number.
    FrameReadError
        If a picture cannot be read.
    """
    if not (np.isfinite(min_motion) and min_motion >= 0):
        raise ConfigError(f"min_motion: got {min_motion!r}, expected a number of at least 0")
    if min_motion == 0:
        return traverse
    kept: list[Frame] = []
    last: FloatArray | None = None
    for frame in progress(traverse, total=len(traverse), label=f"stops of {traverse.name}"):
        thumbnail = _thumbnail(frame)
        if last is None or _motion(last, thumbnail) >= min_motion:
            kept.append(frame)
            last = thumbnail
    n_left_out = len(traverse) - len(kept)
    source = f"{traverse.source}, {n_left_out} frames without motion (below {min_motion:g}) removed"
    return replace(traverse, source=source, frames=tuple(kept)) if n_left_out else traverse


def _thumbnail(frame: Frame) -> FloatArray:
    return _normalised(frame.grey())


def _normalised(grey: ImageArray) -> FloatArray:
    """Return float32 (32, 64) of mean 0 and standard deviation 1, or less if nearly flat."""
    import cv2

    resized = cv2.resize(grey, THUMBNAIL, interpolation=cv2.INTER_AREA)
    # The mean over 3 x 3 costs motion little and noise two thirds.
    small = np.asarray(cv2.blur(resized.astype(np.float32), (3, 3)))
    normalised: FloatArray = (small - small.mean()) / np.float32(max(small.std(), MIN_CONTRAST))
    return normalised


def _motion(first: FloatArray, second: FloatArray) -> float:
    return float(np.abs(first - second).mean())
