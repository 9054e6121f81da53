"""Painted surfaces of houses: fronts with windows, doors and shops, end walls, roofs.

Each surface becomes a texture for one drive: colours under that drive's light, with lit
windows, lamp light and snow already in it. Heights are metres above the ground.
"""

import math
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.canvas import FULL, Point, Texture
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.noise import fractal_noise
from retraverse.datasets.simulated.openings import (
    SNOW,
    Sheet,
    Windows,
    paint_door,
    paint_glass,
    paint_storey,
    paint_window,
    window_kind,
)
from retraverse.datasets.simulated.things import Building, WallKind
from retraverse.types import FloatArray, ImageArray

__all__ = ["paint_end_wall", "paint_front", "paint_roof"]

PX = 24
"""Texture pixels a metre."""
TILE = 256
SHOP_COLOURS = ((150, 40, 38), (36, 74, 110), (40, 92, 66), (196, 150, 50), (70, 52, 92),
                (50, 52, 56))  # fmt: skip


@lru_cache(maxsize=8)
def _pattern(kind: WallKind) -> FloatArray:
    """Return the grain of a wall material around 1.0, a tile of about 10 m."""
    rng = np.random.default_rng([hash_name(kind), 11])
    grain = fractal_noise((TILE, TILE), hash_name(kind), cells=24, octaves=3)
    stain = fractal_noise((TILE, TILE), hash_name(kind) + 1, cells=2, octaves=4)
    tile = 0.86 + 0.12 * grain + 0.16 * (stain - 0.5) + 0.06
    if kind == "brick":
        for row in range(0, TILE, 4):
            tones = np.repeat(rng.uniform(0.86, 1.1, TILE // 8), 8).astype(np.float32)
            tile[row : row + 4] *= np.roll(tones, 4 * (row // 4 % 2))
            tile[row] *= 0.86
    elif kind == "panel":
        for start in range(0, TILE, 64):
            tile[start : start + 2] *= 0.72
            tile[:, start : start + 2] *= 0.76
    elif kind == "timber":
        for row in range(0, TILE, 6):
            tile[row : row + 2] *= 0.8
            tile[row + 2 : row + 4] *= 1.06
    tile.setflags(write=False)
    return np.asarray(tile, np.float32)


def hash_name(name: str) -> int:
    """Return a small number that depends on the name alone (`hash` differs between runs)."""
    return sum((i + 1) * ord(letter) for i, letter in enumerate(name))


def _cover(sheet: Sheet, building: Building, rng: np.random.Generator) -> None:
    """Fill the sheet with the wall's material."""
    rows, columns = sheet.colours.shape[:2]
    tile = np.roll(_pattern(building.wall), tuple(rng.integers(0, TILE // 8, 2) * 8), (0, 1))
    repeats = (math.ceil(rows / TILE), math.ceil(columns / TILE))
    grain = np.tile(tile, repeats)[:rows, :columns, None]
    sheet.colours[:] = np.clip(grain * np.array(building.colour, np.float32), 0, 255)


def paint_front(building: Building, look: Look, light: FloatArray) -> Texture:
    """Return the front of a house.

    Parameters
    ----------
    building : Building
    look : Look
    light : float32 (rows, columns, 3)
        Light on the wall, top row first, from its start to its end along the street; enlarged
        to the wall's size.
    """
    rng = np.random.default_rng([building.seed, 20])
    width = building.end_m - building.start_m
    gable = building.roof_m if building.roof == "gable" else 0.0
    sheet = Sheet(width, building.eaves_m + gable, PX / 3 if building.is_backdrop else PX)
    _cover(sheet, building, rng)
    windows = window_kind(rng, building, width)
    first = 1 if building.ground_floor != "home" else 0
    for storey in range(first, building.storeys):
        paint_storey(sheet, building, windows, rng, look, storey, has_door=storey == 0)
    if building.ground_floor == "shop":
        _shop(sheet, building, rng, look)
    elif building.ground_floor == "garage":
        _garage(sheet, building, windows, rng, look)
    _edges(sheet, building, look)
    if gable > 1.6 and building.storeys * building.storey_m + 1.9 < sheet.height_m:
        paint_window(sheet, windows, rng, look, width / 2 - 0.4, building.eaves_m + 0.1, 0.8, 1.0)
    return Texture(_lit(sheet, look, light), _outline(building.eaves_m, gable))


def _outline(eaves_m: float, gable_m: float) -> list[Point]:
    """Return the outline of a wall with a gable on it."""
    if gable_m <= 0:
        return FULL
    edge = gable_m / (eaves_m + gable_m)
    return [(0.5, 0.0), (1.0, edge), (1.0, 1.0), (0.0, 1.0), (0.0, edge)]


def _shop(sheet: Sheet, building: Building, rng: np.random.Generator, look: Look) -> None:
    """Paint a shop: a wide pane, door, sign with pretended letters, sometimes an awning."""
    top, width = building.storey_m, sheet.width_m
    accent = SHOP_COLOURS[int(rng.integers(6))]
    sheet.box(0.2, 0.0, width - 0.2, top - 0.1, tuple(int(c * 0.55) for c in accent))
    panes = max(2, round(width / 2.6))
    step = (width - 0.8) / panes
    for pane in range(panes):
        x = 0.4 + pane * step
        bottom = 0.1 if pane == panes // 2 else 0.6
        paint_glass(sheet, rng, look, x + 0.06, bottom, x + step - 0.06, top - 0.85)
        for _ in range(4):
            at = x + float(rng.uniform(0.15, step - 0.5))
            goods = tuple(int(c) for c in rng.integers(70, 190, 3))
            sheet.box(at, bottom + 0.1, at + 0.3, bottom + float(rng.uniform(0.4, 1.1)), goods)
        shine = np.array([255, 236, 196]) * np.float32(look.lamps * rng.uniform(0.45, 0.9))
        sheet.light(x + 0.06, bottom, x + step - 0.06, top - 0.85, shine)
    sheet.box(0.2, top - 0.7, width - 0.2, top - 0.05, accent)
    x = width * float(rng.uniform(0.1, 0.3))
    while x < width * 0.75:
        letter = float(rng.uniform(0.16, 0.36))
        sheet.box(x, top - 0.56, x + letter, top - 0.22, (238, 232, 216))
        sheet.light(x, top - 0.56, x + letter, top - 0.22, np.array([255, 244, 220]) * look.lamps)
        x += letter + 0.1
    if rng.random() < 0.45:
        _awning(sheet, accent, top)


def _awning(sheet: Sheet, accent: tuple[int, int, int], top: float) -> None:
    """Paint a striped awning and its shadow."""
    stripes = np.arange(0.3, sheet.width_m - 0.5, 0.5)
    sheet.box(0.3, top - 1.75, sheet.width_m - 0.3, top - 1.45, (52, 52, 54))
    for k, x in enumerate(stripes):
        colour = accent if k % 2 else (232, 228, 218)
        sheet.box(x, top - 1.5, x + 0.5, top - 0.72, colour)


def _garage(
    sheet: Sheet, building: Building, windows: Windows, rng: np.random.Generator, look: Look
) -> None:
    """Paint a garage door, the house door, and a window in the rest of the ground floor."""
    start = 0.6 if rng.random() < 0.5 else sheet.width_m - 3.4
    tone = int(rng.integers(130, 226))
    sheet.box(start - 0.12, 0.0, start + 2.72, 2.35, building.trim)
    for row in range(4):
        low = 0.02 + row * 0.56
        sheet.box(start, low, start + 2.6, low + 0.5, (tone, tone - 4, tone - 10))
    other = 4.2 if start < 1 else 0.8
    paint_door(sheet, rng, look, other, building.trim)
    if sheet.width_m > 8.5:
        paint_window(sheet, windows, rng, look, other + 2.0, 1.2, min(windows.width, 1.6), 1.2)


def _edges(sheet: Sheet, building: Building, look: Look) -> None:
    """Paint plinth, storey bands, eaves and a downpipe."""
    width, eaves = sheet.width_m, building.eaves_m
    dark = tuple(int(c * 0.62) for c in building.colour)
    if building.ground_floor != "shop":
        for row in (0.0, 0.2):
            sheet.colours[sheet.area(0, row, width, row + 0.2)] //= 4
            sheet.colours[sheet.area(0, row, width, row + 0.2)] += np.array(
                [int(c * 0.62) for c in dark], np.uint8
            )
    if building.seed % 2 and building.storeys > 1:
        band = 0.5 + building.storey_m
        sheet.box(0, band - 0.05, width, band + 0.14, building.trim)
    sheet.box(0, eaves - 0.5, width, eaves - 0.22, (104, 100, 98))
    sheet.box(0, eaves - 0.25, width, eaves, building.trim)
    pipe = 0.12 if building.seed % 5 < 3 else width - 0.26
    sheet.box(pipe, 0.1, pipe + 0.12, eaves - 0.3, (92, 94, 98))
    if look.snow > 0.05:
        sheet.box(0, eaves - 0.14 * look.snow, width, eaves, SNOW)


def paint_end_wall(building: Building, look: Look, light: FloatArray) -> Texture:
    """Return the end wall that faces a coming camera, with its gable; arguments as the front."""
    rng = np.random.default_rng([building.seed, 21])
    gable = building.roof_m if building.roof == "ridge" else 0.0
    sheet = Sheet(building.depth_m, building.eaves_m + gable, PX / 2)
    _cover(sheet, building, rng)
    windows = window_kind(rng, building, building.depth_m)
    if building.is_corner:
        for storey in range(building.storeys):
            paint_storey(sheet, building, windows, rng, look, storey, has_door=False)
    else:
        for storey in range(building.storeys):
            if rng.random() < 0.5:
                x = building.depth_m * float(rng.uniform(0.25, 0.7))
                sill = 1.3 + storey * building.storey_m
                paint_window(sheet, windows, rng, look, x, sill, 0.9, 1.2)
    return Texture(_lit(sheet, look, light), _outline(building.eaves_m, gable))


def paint_roof(building: Building, look: Look, light: FloatArray, slope_m: float) -> Texture:
    """Return a roof's slope, ridge at the top, `slope_m` from eaves to ridge."""
    rng = np.random.default_rng([building.seed, 22])
    length = building.end_m - building.start_m
    if building.roof == "gable":
        length = building.depth_m
    sheet = Sheet(length, slope_m, PX / 2)
    rows, columns = sheet.colours.shape[:2]
    grain = fractal_noise((TILE, TILE), 77, cells=32, octaves=3)
    grain = np.tile(grain, (rows // TILE + 1, columns // TILE + 1))[:rows, :columns, None]
    tiles = (0.75 + 0.4 * grain) * np.where(np.arange(rows) % 5 == 4, 0.8, 1.0)[:, None, None]
    sheet.colours[:] = np.clip(tiles * np.array(building.roof_colour, np.float32), 0, 255)
    _snow_cover(sheet, look, building.seed)
    if building.roof != "gable" and (building.roof == "mansard" or rng.random() < 0.4):
        _roof_windows(sheet, building, rng, look)
    return Texture(_lit(sheet, look, light))


def _snow_cover(sheet: Sheet, look: Look, seed: int) -> None:
    """Lay snow where a noise field is below the cover; edges thaw first."""
    if look.snow <= 0:
        return
    rows, columns = sheet.colours.shape[:2]
    field = fractal_noise((TILE, TILE), seed % 5 + 30, cells=6, octaves=4)
    field = np.tile(field, (rows // TILE + 1, columns // TILE + 1))[:rows, :columns]
    cover = np.clip((1.15 * look.snow - field) * 6, 0, 0.96)[:, :, None]
    white = np.array(SNOW, np.float32) * np.float32(0.94)
    sheet.colours[:] = sheet.colours * (1 - cover) + white * cover


def _roof_windows(sheet: Sheet, building: Building, rng: np.random.Generator, look: Look) -> None:
    """Paint dormers on a mansard, skylights on a slope."""
    count = max(1, round(sheet.width_m / float(rng.uniform(3, 4.5))))
    low, height = sheet.height_m * 0.25, min(1.5, sheet.height_m * 0.5)
    for k in range(count):
        x = (k + 0.5) * sheet.width_m / count - 0.5
        if building.roof == "mansard":
            sheet.box(x - 0.25, low - 0.2, x + 1.25, low + height + 0.3, building.trim)
            sheet.box(x - 0.35, low + height + 0.25, x + 1.35, low + height + 0.45, (70, 70, 74))
        else:
            sheet.box(x - 0.06, low - 0.06, x + 1.06, low + height + 0.06, (60, 60, 62))
        paint_glass(sheet, rng, look, x, low, x + 1.0, low + height)


def _lit(sheet: Sheet, look: Look, light: FloatArray) -> ImageArray:
    """Return the sheet's colours under the light, dimmer at the ground, plus its own lights."""
    import cv2

    rows, columns = sheet.colours.shape[:2]
    large = np.asarray(
        cv2.resize(light, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32
    )
    foot = max(1, min(rows, round(1.3 * sheet.px)))
    large[-foot:] *= np.linspace(1.0, 0.66, foot, dtype=np.float32)[:, None, None]
    shone = cv2.multiply(sheet.colours, large, dtype=cv2.CV_8U)
    if look.lamps <= 0:
        return np.asarray(shone)
    return np.asarray(cv2.add(shone, sheet.lights))
