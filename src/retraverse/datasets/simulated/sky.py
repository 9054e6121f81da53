"""Sky and distant skyline: a panorama painted once per drive, cut to each frame's heading."""

import math

import numpy as np

from retraverse.datasets.simulated.camera import Camera
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.lighting import SUN_ELEVATION
from retraverse.datasets.simulated.noise import blend, fractal_noise
from retraverse.types import FloatArray, ImageArray

__all__ = ["SkyWindow", "paint_panorama"]

ROWS, COLUMNS = 420, 2160
LOW, HIGH = math.radians(-4), math.radians(52)
"""Elevation of the lowest and highest row."""


def paint_panorama(seed: int, sun_azimuth: float, look: Look) -> ImageArray:
    """Return the sky all around, uint8 (420, 2160, 3); column 0 looks along heading 0.

    Headings grow with the column; the rows go from 52 degrees above the horizon down to 4 below.
    """
    elevation = np.linspace(HIGH, LOW, ROWS, dtype=np.float32)[:, None]
    azimuth = np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False, dtype=np.float32)[None]
    height = np.clip(elevation / HIGH, 0, 1) ** 0.6
    sky = look.horizon + height[:, :, None] * (look.zenith - look.horizon)
    sky = np.broadcast_to(sky, (ROWS, COLUMNS, 3)).copy()
    _add_sun_glare(sky, elevation, azimuth - sun_azimuth, look)
    _add_clouds(sky, elevation, azimuth, seed, look)
    if look.darkness > 0.6:
        _add_stars(sky, seed, look)
    for layer in range(3):
        _add_skyline(sky, seed, layer, look)
    return np.asarray(np.clip(sky, 0, 255).astype(np.uint8))


def _add_sun_glare(sky: FloatArray, elevation: FloatArray, turn: FloatArray, look: Look) -> None:
    """Brighten the sky around the sun."""
    cosine = np.sin(elevation) * math.sin(SUN_ELEVATION) + np.cos(elevation) * math.cos(
        SUN_ELEVATION
    ) * np.cos(turn)
    glare = np.clip(cosine, 0, 1) ** 14
    sky += glare[:, :, None] * (look.sun * np.float32(110))


def _add_clouds(
    sky: FloatArray, elevation: FloatArray, azimuth: FloatArray, seed: int, look: Look
) -> None:
    """Lay clouds on a plane high above: they shrink towards the horizon."""
    import cv2

    tile = fractal_noise((512, 512), seed + 501, cells=4, octaves=6)
    reach = 1.0 / np.tan(np.maximum(elevation, 0.03) + 0.10)
    east = ((reach * np.cos(azimuth) * 46 + 4096) % 512).astype(np.float32)
    north = ((reach * np.sin(azimuth) * 46 + 4096) % 512).astype(np.float32)
    field = cv2.remap(tile, east, north, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    threshold = 0.86 - 0.62 * look.clouds
    cover = np.clip((field - threshold) * 3.2, 0, 0.92) * np.clip(elevation / 0.05, 0.0, 1)
    top = blend(look.horizon, np.full(3, 255, np.float32), 0.55 * (1 - look.darkness))
    under = blend(look.horizon, look.zenith, 0.5) * np.float32(0.93)
    shade = np.clip((field - threshold - 0.12) * 2.4, 0, 1)[:, :, None]
    cloud = top + shade * (under - top)
    sky += cover[:, :, None] * (cloud - sky)


def _add_stars(sky: FloatArray, seed: int, look: Look) -> None:
    rng = np.random.default_rng([seed, 52])
    rows, columns = rng.integers(0, ROWS - 60, 260), rng.integers(0, COLUMNS, 260)
    sky[rows, columns] += rng.uniform(10, 90, (260, 1)) * (look.darkness - 0.6) * 2


def _add_skyline(sky: FloatArray, seed: int, layer: int, look: Look) -> None:
    """Add hills (layer 0), far blocks and towers (1), and near roofs and tree tops (2)."""
    rng = np.random.default_rng([seed, 53, layer])
    ground = round(ROWS * HIGH / (HIGH - LOW))
    degree = ROWS / math.degrees(HIGH - LOW)
    noise = fractal_noise((64, COLUMNS), seed + 60 + layer, cells=2, octaves=6)[0]
    heights = (noise * (5.5, 2.4, 2.6)[layer]) * degree
    if layer == 1:
        for _ in range(70):
            start, width = int(rng.integers(COLUMNS)), int(rng.integers(6, 26))
            tall = float(rng.uniform(1.2, 3.6) if rng.random() < 0.88 else rng.uniform(4, 9))
            heights[np.arange(start, start + width) % COLUMNS] = tall * degree
    dark = np.array(((112, 126, 136), (104, 108, 114), (74, 82, 70))[layer], np.float32)
    dark = blend(dark, np.array([226, 230, 236], np.float32), look.snow * (0.55, 0.25, 0.4)[layer])
    lit = dark * (look.ambient + look.sun * np.float32(0.4))
    weight = np.exp(-np.array((900.0, 520.0, 260.0))[layer] / look.sight_m)
    colour = blend(look.haze, lit, float(np.clip(weight * 1.25, 0.04, 0.85)))
    rows = np.arange(ROWS)[:, None]
    sky[rows > ground - heights[None]] = colour
    if layer == 1 and look.lamps > 0:
        _light_far_windows(sky, heights, ground, rng, look)


def _light_far_windows(
    sky: FloatArray, heights: FloatArray, ground: int, rng: np.random.Generator, look: Look
) -> None:
    columns = rng.integers(0, COLUMNS, 900)
    rows = (ground - rng.random(900) * heights[columns]).astype(int)
    warm = np.array([255, 208, 140], np.float32) * np.float32(0.6 * look.lamps)
    sky[np.clip(rows, 0, ROWS - 1), columns] += warm


PAD = 40
"""Rows repeated above and below a panorama, for pitch."""


class SkyWindow:
    """Cuts a camera's part out of a panorama, to the nearest sixth of a degree."""

    def __init__(self, camera: Camera) -> None:
        import cv2

        height, width = camera.canvas
        self.rows = min(height, round(height * camera.horizon + 0.06 * camera.focal))
        dx = (np.arange(width, dtype=np.float32) + 0.5 - width / 2)[None]
        dy = height * camera.horizon - (np.arange(self.rows, dtype=np.float32) + 0.5)[:, None]
        azimuth = -np.arctan(dx / camera.focal)
        elevation = np.arctan(dy / np.hypot(dx, camera.focal))
        columns = np.broadcast_to(azimuth * (COLUMNS / (2 * np.pi)), elevation.shape)
        rows = (HIGH - elevation) * ((ROWS - 1) / (HIGH - LOW)) + PAD
        self._left = math.floor(columns.min())
        self._width = math.ceil(columns.max()) - self._left + 2
        self._maps = cv2.convertMaps(
            (columns - self._left).astype(np.float32), rows.astype(np.float32), cv2.CV_16SC2
        )

    def padded(self, panorama: ImageArray) -> ImageArray:
        """Return a panorama with its edges repeated, so that any window is one slice of it."""
        turns = np.arange(-self._width, COLUMNS + self._width) % COLUMNS
        rows = np.clip(np.arange(-2 * PAD, ROWS + 2 * PAD), 0, ROWS - 1)
        return np.ascontiguousarray(panorama[rows][:, turns])

    def cut(self, padded: ImageArray, heading: float, pitch: float) -> ImageArray:
        """Return the sky for a heading (radians), from the top row to just below the horizon."""
        import cv2

        left = round(heading * COLUMNS / (2 * np.pi)) + self._left
        left = left % COLUMNS + self._width
        # A pitch upwards moves the horizon down: the same row then shows a higher place.
        up = min(max(round(pitch * (ROWS - 1) / (HIGH - LOW)), -PAD), PAD)
        window = padded[PAD - up : ROWS + 3 * PAD - up, left : left + self._width]
        first, second = self._maps
        return np.asarray(cv2.remap(window, first, second, cv2.INTER_LINEAR,
                                    borderMode=cv2.BORDER_REPLICATE), np.uint8)  # fmt: skip
