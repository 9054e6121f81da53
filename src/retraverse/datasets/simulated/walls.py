"""Painted surfaces of houses: fronts with windows, doors and shops, end walls, roofs.

Each surface becomes a texture for one drive: colours under that drive's light, with lit
windows, lamp light and snow already in it. Heights are metres above the ground.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.canvas import FULL, Point, Texture
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.noise import fractal_noise
from retraverse.datasets.simulated.things import Building, WallKind
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["paint_end_wall", "paint_front", "paint_roof"]

PX = 24
"""Texture pixels a metre."""
SNOW = (236, 240, 246)
TILE = 256
SHOP_COLOURS = ((150, 40, 38), (36, 74, 110), (40, 92, 66), (196, 150, 50), (70, 52, 92),
                (50, 52, 56))  # fmt: skip


class Sheet:
    """A wall while it is painted: colours, and the light that it gives off by itself."""

    def __init__(self, width_m: float, height_m: float, px: float) -> None:
        self.px, self.width_m, self.height_m = px, width_m, height_m
        rows, columns = max(4, round(height_m * px)), max(4, round(width_m * px))
        self.colours: ImageArray = np.zeros((rows, columns, 3), np.uint8)
        self.lights: ImageArray = np.zeros((rows, columns, 3), np.uint8)

    def area(self, x0: float, z0: float, x1: float, z1: float) -> tuple[slice, slice]:
        """Return the rows and columns of a rectangle, at least one pixel each."""
        rows, columns = self.colours.shape[:2]
        top, bottom = round(rows - z1 * self.px), round(rows - z0 * self.px)
        left, right = round(x0 * self.px), round(x1 * self.px)
        top, left = min(max(top, 0), rows), min(max(left, 0), columns)
        return slice(top, max(bottom, top + 1, 0)), slice(left, max(right, left + 1, 0))

    def box(
        self, x0: float, z0: float, x1: float, z1: float, colour: tuple[int, ...] | ImageArray
    ) -> None:
        """Fill a rectangle with a colour."""
        self.colours[self.area(x0, z0, x1, z1)] = colour

    def light(self, x0: float, z0: float, x1: float, z1: float, colour: Array) -> None:
        """Make a rectangle shine."""
        self.lights[self.area(x0, z0, x1, z1)] = np.clip(colour, 0, 255)


@dataclass(frozen=True)
class _Windows:
    """The one kind of window that a house has."""

    width: float
    height: float
    bays: int
    panes: int
    has_shutters: bool
    has_lintel: bool
    shutter: tuple[int, int, int]
    frame: tuple[int, int, int]


def _window_kind(rng: np.random.Generator, building: Building, width_m: float) -> _Windows:
    pitch = float(rng.uniform(2.1, 3.4)) if building.wall != "panel" else float(rng.uniform(2, 2.8))
    wide = building.wall == "panel" or rng.random() < 0.25
    shutters = ((70, 92, 78), (96, 60, 52), (70, 82, 104), (120, 110, 96))
    return _Windows(
        width=pitch * 0.66 if wide else float(rng.uniform(0.9, 1.2)),
        height=float(rng.uniform(1.25, 1.8)),
        bays=max(1, round(width_m / pitch)),
        panes=int(rng.integers(1, 4)),
        has_shutters=not wide and building.wall == "plaster" and rng.random() < 0.4,
        has_lintel=building.wall == "brick" or rng.random() < 0.5,
        shutter=shutters[int(rng.integers(4))],
        frame=building.trim,
    )


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
    windows = _window_kind(rng, building, width)
    first = 1 if building.ground_floor != "home" else 0
    for storey in range(first, building.storeys):
        _storey(sheet, building, windows, rng, look, storey, has_door=storey == 0)
    if building.ground_floor == "shop":
        _shop(sheet, building, rng, look)
    elif building.ground_floor == "garage":
        _garage(sheet, building, windows, rng, look)
    _edges(sheet, building, look)
    if gable > 1.6 and building.storeys * building.storey_m + 1.9 < sheet.height_m:
        _window(sheet, windows, rng, look, width / 2 - 0.4, building.eaves_m + 0.1, 0.8, 1.0)
    return Texture(_lit(sheet, look, light), _outline(building.eaves_m, gable))


def _outline(eaves_m: float, gable_m: float) -> list[Point]:
    """Return the outline of a wall with a gable on it."""
    if gable_m <= 0:
        return FULL
    edge = gable_m / (eaves_m + gable_m)
    return [(0.5, 0.0), (1.0, edge), (1.0, 1.0), (0.0, 1.0), (0.0, edge)]


def _storey(
    sheet: Sheet, building: Building, windows: _Windows, rng: np.random.Generator, look: Look,
    storey: int, *, has_door: bool,
) -> None:  # fmt: skip
    """Paint one row of windows, with the door among them on the ground floor."""
    pitch = sheet.width_m / windows.bays
    door = int(rng.integers(windows.bays)) if has_door else -1
    sill = 0.5 + storey * building.storey_m + 0.75
    height = min(windows.height, building.storey_m - 1.05)
    balconies = building.storeys >= 3 and storey > 0 and building.seed % 3 == 0
    for bay in range(windows.bays):
        x = (bay + 0.5) * pitch - windows.width / 2
        if bay == door:
            _door(sheet, rng, look, (bay + 0.5) * pitch - 0.5, building.trim)
        else:
            _window(sheet, windows, rng, look, x, sill, windows.width, height)
        if balconies and bay % 2 == building.seed // 3 % 2:
            _balcony(sheet, x - 0.25, sill - 0.75, windows.width + 0.5)


def _balcony(sheet: Sheet, x: float, z: float, width: float) -> None:
    """Paint a slab and its railing, and the shadow under it."""
    sheet.box(x, z - 0.55, x + width, z - 0.15, (84, 82, 82))
    sheet.box(x, z - 0.15, x + width, z, (176, 174, 170))
    for bar in np.arange(x, x + width, 0.17):
        sheet.box(bar, z, bar + 0.04, z + 0.95, (58, 60, 64))
    sheet.box(x, z + 0.92, x + width, z + 1.0, (58, 60, 64))


def _window(
    sheet: Sheet, kind: _Windows, rng: np.random.Generator, look: Look,
    x: float, z: float, width: float, height: float,
) -> None:  # fmt: skip
    """Paint one window: reveal, frame, panes that mirror the sky, curtains, sill, snow."""
    top, right = z + height, x + width
    if kind.has_shutters:
        for side in (x - width * 0.52, right + width * 0.04):
            sheet.box(side, z, side + width * 0.48, top, kind.shutter)
    if kind.has_lintel:
        sheet.box(x - 0.15, top, right + 0.15, top + 0.22, kind.frame)
    sheet.box(x - 0.06, z - 0.06, right + 0.06, top + 0.06, kind.frame)
    _glass(sheet, rng, look, x, z, right, top)
    sheet.box(x, top - 0.12, right, top, (46, 48, 52))
    for pane in range(1, kind.panes):
        middle = x + width * pane / kind.panes
        sheet.box(middle - 0.03, z, middle + 0.03, top, kind.frame)
    if kind.panes > 1:
        sheet.box(x, z + height * 0.62, right, z + height * 0.62 + 0.06, kind.frame)
    sheet.box(x - 0.12, z - 0.16, right + 0.12, z - 0.05, (196, 192, 184))
    sheet.box(x - 0.12, z - 0.26, right + 0.12, z - 0.16, (88, 84, 82))
    if look.snow > 0.15:
        sheet.box(x - 0.12, z - 0.07, right + 0.12, z - 0.05 + 0.14 * look.snow, SNOW)


def _glass(
    sheet: Sheet, rng: np.random.Generator, look: Look, x: float, z: float, right: float, top: float
) -> None:
    """Paint a pane: dark below, the sky's mirror above, a curtain or lamp behind it."""
    tone, bright = float(rng.uniform(0.5, 1.25)), float(rng.uniform(0.3, 1.0))
    is_lit, curtain = rng.random() < 0.5, rng.random()
    warm = np.array([255, rng.uniform(186, 226), rng.uniform(110, 170)], np.float32)
    rows, columns = sheet.area(x, z, right, top)
    ramp = np.linspace(1.0, 0.0, max(1, rows.stop - rows.start), dtype=np.float32)[:, None, None]
    glass = tone * (np.array([44, 52, 60]) + ramp * bright * np.array([86, 98, 112]))
    sheet.colours[rows, columns] = np.clip(glass, 0, 235)[: sheet.colours[rows].shape[0]]
    if curtain < 0.35:
        for a, b in ((x, x + (right - x) * 0.24), (right - (right - x) * 0.24, right)):
            sheet.box(a, z, b, top, (178, 174, 166))
    elif curtain < 0.5:
        sheet.box(x, z + (top - z) * float(rng.uniform(0.3, 0.8)), right, top, (196, 190, 178))
    if is_lit and look.lamps > 0:
        sheet.light(x, z, right, top, warm * np.float32(look.lamps * (0.45 + 0.5 * bright)))


def _door(
    sheet: Sheet, rng: np.random.Generator, look: Look, x: float, trim: tuple[int, int, int]
) -> None:
    """Paint a door with steps, a fanlight and a lamp beside it."""
    colours = ((92, 44, 36), (40, 62, 52), (44, 54, 80), (70, 50, 36), (128, 34, 34), (40, 42, 46))
    colour = colours[int(rng.integers(6))]
    sheet.box(x - 0.16, 0.3, x + 1.16, 2.75, trim)
    sheet.box(x, 0.3, x + 1.0, 2.3, colour)
    sheet.box(x + 0.14, 1.4, x + 0.86, 2.1, tuple(int(c * 0.72) for c in colour))
    sheet.box(x + 0.14, 0.5, x + 0.86, 1.2, tuple(int(c * 0.78) for c in colour))
    _glass(sheet, rng, look, x, 2.36, x + 1.0, 2.66)
    sheet.box(x - 0.3, 0.0, x + 1.3, 0.3, (150, 146, 140))
    sheet.box(x - 0.3, 0.12, x + 1.3, 0.16, (104, 102, 98))
    sheet.light(x + 1.3, 2.05, x + 1.5, 2.35, np.array([255, 214, 150]) * look.lamps)


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
        _glass(sheet, rng, look, x + 0.06, bottom, x + step - 0.06, top - 0.85)
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
    sheet: Sheet, building: Building, windows: _Windows, rng: np.random.Generator, look: Look
) -> None:
    """Paint a garage door, the house door, and a window in the rest of the ground floor."""
    start = 0.6 if rng.random() < 0.5 else sheet.width_m - 3.4
    tone = int(rng.integers(130, 226))
    sheet.box(start - 0.12, 0.0, start + 2.72, 2.35, building.trim)
    for row in range(4):
        low = 0.02 + row * 0.56
        sheet.box(start, low, start + 2.6, low + 0.5, (tone, tone - 4, tone - 10))
    other = 4.2 if start < 1 else 0.8
    _door(sheet, rng, look, other, building.trim)
    if sheet.width_m > 8.5:
        _window(sheet, windows, rng, look, other + 2.0, 1.2, min(windows.width, 1.6), 1.2)


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
    windows = _window_kind(rng, building, building.depth_m)
    if building.is_corner:
        for storey in range(building.storeys):
            _storey(sheet, building, windows, rng, look, storey, has_door=False)
    else:
        for storey in range(building.storeys):
            if rng.random() < 0.5:
                x = building.depth_m * float(rng.uniform(0.25, 0.7))
                sill = 1.3 + storey * building.storey_m
                _window(sheet, windows, rng, look, x, sill, 0.9, 1.2)
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
        _glass(sheet, rng, look, x, low, x + 1.0, low + height)


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
