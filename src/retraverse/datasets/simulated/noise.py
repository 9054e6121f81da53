"""Cheap seeded noise textures: the grain of plaster, asphalt, leaves and clouds."""

from functools import lru_cache

import numpy as np

from retraverse.types import FloatArray

__all__ = ["blend", "fractal_noise", "smooth_step"]


@lru_cache(maxsize=32)
def fractal_noise(
    shape: tuple[int, int], seed: int, *, cells: int = 4, octaves: int = 5, fade: float = 0.55
) -> FloatArray:
    """Return tileable value noise in [0, 1].

    Random grids of doubling fineness, smoothly enlarged and summed. The result is cached and
    read-only, because several painters share one texture.

    Parameters
    ----------
    shape : (rows, columns)
        Size in pixels.
    seed : int
        Same seed, same noise.
    cells : int
        Grid cells along the shorter side in the coarsest octave.
    octaves : int
        How many grids are summed.
    fade : float in (0, 1)
        Weight of each octave relative to the one before.
    """
    rng = np.random.default_rng([seed, 0x6E6F])
    total = np.zeros(shape, np.float32)
    for octave in range(octaves):
        n = cells * 2**octave
        if n > min(shape):
            break
        grid = (n * shape[0] // min(shape), n * shape[1] // min(shape))
        total += fade**octave * _enlarge_tiled(rng.random(grid, dtype=np.float32), shape)
    low, high = float(total.min()), float(total.max())
    result = (total - low) / max(high - low, 1e-6)
    result.setflags(write=False)
    return result


def _enlarge_tiled(grid: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Enlarge a grid so that opposite edges meet: pad by wrapping, resize, cut the pad off."""
    import cv2

    padded = np.pad(grid, 2, mode="wrap")
    scale = (shape[0] / grid.shape[0], shape[1] / grid.shape[1])
    rows, columns = (round(padded.shape[axis] * scale[axis]) for axis in (0, 1))
    large = cv2.resize(padded, (columns, rows), interpolation=cv2.INTER_CUBIC)
    top, left = round(2 * scale[0]), round(2 * scale[1])
    return np.asarray(large[top : top + shape[0], left : left + shape[1]], np.float32)


def smooth_step(low: float, high: float, value: float) -> float:
    """Return 0 below `low`, 1 above `high`, and a smooth rise between them."""
    t = min(max((value - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def blend(first: FloatArray, second: FloatArray, weight: float) -> FloatArray:
    """Return `first` moved towards `second` by `weight` in [0, 1]."""
    mixed: FloatArray = first + (second - first) * np.float32(weight)
    return mixed
