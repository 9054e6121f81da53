"""From the painted canvas to what a camera delivers: glow, wet road, rain, size, noise."""

import math
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.canvas import Canvas
from retraverse.types import FloatArray, ImageArray

__all__ = ["finish"]

NOISE = 10.0
"""Standard deviation of the sensor's noise at full night, grey levels."""


def finish(canvas: Canvas, rng: np.random.Generator) -> ImageArray:
    """Return the frame, uint8 (height, width, 3) RGB, at the camera's own size."""
    import cv2

    look, camera = canvas.look, canvas.view.camera
    if look.wet > 0:
        _mirror_in_road(canvas)
    for column, row, radius, colour in canvas.glows:
        _add_glow(canvas.pixels, column, row, radius, colour)
    size = (camera.width, camera.height)
    picture = np.asarray(cv2.resize(canvas.pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    if look.darkness > 0.1:
        picture = _bloom(picture, look.darkness)
    picture = np.asarray(cv2.multiply(picture, _vignette(*size), dtype=cv2.CV_8U), np.uint8)
    if look.rain > 0:
        picture = _streaks(picture, look.rain, rng)
    if look.darkness > 0:
        picture = _add_noise(picture, NOISE * look.darkness**1.5, rng)
    return picture


@lru_cache(maxsize=1)
def _glow_sprite() -> FloatArray:
    axis = np.linspace(-2.6, 2.6, 65, dtype=np.float32)
    square = axis[None] ** 2 + axis[:, None] ** 2
    return np.asarray(np.clip(np.exp(-square) - 0.0012, 0, 1), np.float32)


def _add_glow(
    pixels: ImageArray, column: float, row: float, radius: float, colour: FloatArray
) -> None:
    """Add a soft round light."""
    import cv2

    height, width = pixels.shape[:2]
    reach = min(max(2.6 * radius, 1.5), 260.0)
    left, right = max(0, math.floor(column - reach)), min(width, math.ceil(column + reach))
    top, bottom = max(0, math.floor(row - reach)), min(height, math.ceil(row + reach))
    if right - left < 1 or bottom - top < 1:
        return
    scale = 32.0 / reach
    moved = np.array([[scale, 0, 32 + (left + 0.5 - column) * scale],
                      [0, scale, 32 + (top + 0.5 - row) * scale]])  # fmt: skip
    soft = cv2.warpAffine(_glow_sprite(), moved, (right - left, bottom - top),
                          flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)  # fmt: skip
    target = pixels[top:bottom, left:right]
    light = np.clip(soft[:, :, None] * colour, 0, 255).astype(np.uint8)
    cv2.add(target, light, dst=target)


def _mirror_in_road(canvas: Canvas) -> None:
    """Mirror what stands above the horizon in the wet road, smeared downwards."""
    import cv2

    horizon = min(max(round(canvas.view.centre[1]), 1), len(canvas.pixels) - 1)
    below = canvas.pixels[horizon:]
    rows = min(len(below), horizon)
    mirrored = np.ascontiguousarray(canvas.pixels[horizon - rows : horizon][::-1])
    smeared = cv2.blur(mirrored, (5, 41))
    weight = 0.34 * canvas.look.wet
    wet = cv2.addWeighted(below[:rows], 1 - 0.6 * weight, smeared, weight, 0)
    if canvas.bare_ground is not None:
        bare = canvas.bare_ground[horizon : horizon + rows]
        is_bare = (cv2.absdiff(below[:rows], bare).max(axis=2) == 0).astype(np.uint8)
        cv2.copyTo(wet, is_bare, below[:rows])


def _bloom(picture: ImageArray, darkness: float) -> ImageArray:
    """Let bright places spill over, as they do on a camera that sees little light."""
    import cv2

    height, width = picture.shape[:2]
    small = cv2.resize(picture, (max(1, width // 4), max(1, height // 4)),
                       interpolation=cv2.INTER_AREA)  # fmt: skip
    threshold = np.array([120.0, 120.0, 120.0, 0.0])
    bright = cv2.GaussianBlur(cv2.subtract(small, threshold), (0, 0), 2.2)
    large = cv2.resize(bright, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.addWeighted(picture, 1.0, large, 0.8 * darkness, 0), np.uint8)


@lru_cache(maxsize=4)
def _vignette(width: int, height: int) -> FloatArray:
    """Return how much light reaches each pixel, float32 (height, width, 3)."""
    x = np.linspace(-1, 1, width, dtype=np.float32)[None]
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None]
    fall = 1.0 - 0.13 * (x**2 + 0.7 * y**2)
    return np.ascontiguousarray(np.repeat(fall[:, :, None], 3, axis=2), np.float32)


def _streaks(picture: ImageArray, rain: float, rng: np.random.Generator) -> ImageArray:
    """Draw falling drops as short bright streaks."""
    import cv2

    height, width = picture.shape[:2]
    layer = picture.copy()
    for _ in range(round(160 * rain * width * height / 76800)):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        long = int(rng.integers(4, 14) * height / 240)
        tone = float(rng.uniform(150, 215)) * (0.35 + 0.65 * float(picture[y, x].mean()) / 255)
        cv2.line(layer, (x, y), (x - long // 5, y + long), (tone, tone, tone), 1, cv2.LINE_AA)
    return np.asarray(cv2.addWeighted(picture, 0.55, layer, 0.45, 0), np.uint8)


def _add_noise(picture: ImageArray, deviation: float, rng: np.random.Generator) -> ImageArray:
    """Add sensor noise: mostly the same in all colours, partly not."""
    import cv2

    height, width = picture.shape[:2]
    grey = rng.standard_normal((height, width, 1), np.float32)
    colour = rng.standard_normal((height // 2 + 1, width // 2 + 1, 3), np.float32)
    large = cv2.resize(colour, (width, height), interpolation=cv2.INTER_LINEAR)
    noisy = picture + np.float32(deviation) * (0.8 * grey + 0.5 * large)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
