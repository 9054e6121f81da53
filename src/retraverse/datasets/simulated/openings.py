"""A wall while it is painted, and the openings in it: windows, doors, balconies.

Heights are metres above the ground, places metres from the wall's start.
"""

from dataclasses import dataclass

import numpy as np

from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.things import Building
from retraverse.types import Array, ImageArray

__all__ = [
    "SNOW",
    "Sheet",
    "Windows",
    "paint_door",
    "paint_glass",
    "paint_storey",
    "paint_window",
    "window_kind",
]

SNOW = (236, 240, 246)


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
class Windows:
    """The one kind of window that a house has."""

    width: float
    height: float
    bays: int
    panes: int
    has_shutters: bool
    has_lintel: bool
    shutter: tuple[int, int, int]
    frame: tuple[int, int, int]


def window_kind(rng: np.random.Generator, building: Building, width_m: float) -> Windows:
    """Return the kind of window on a wall of a house, `width_m` wide."""
    pitch = float(rng.uniform(2.1, 3.4)) if building.wall != "panel" else float(rng.uniform(2, 2.8))
    wide = building.wall == "panel" or rng.random() < 0.25
    shutters = ((70, 92, 78), (96, 60, 52), (70, 82, 104), (120, 110, 96))
    return Windows(
        width=pitch * 0.66 if wide else float(rng.uniform(0.9, 1.2)),
        height=float(rng.uniform(1.25, 1.8)),
        bays=max(1, round(width_m / pitch)),
        panes=int(rng.integers(1, 4)),
        has_shutters=not wide and building.wall == "plaster" and rng.random() < 0.4,
        has_lintel=building.wall == "brick" or rng.random() < 0.5,
        shutter=shutters[int(rng.integers(4))],
        frame=building.trim,
    )


def paint_storey(
    sheet: Sheet, building: Building, windows: Windows, rng: np.random.Generator, look: Look,
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
            paint_door(sheet, rng, look, (bay + 0.5) * pitch - 0.5, building.trim)
        else:
            paint_window(sheet, windows, rng, look, x, sill, windows.width, height)
        if balconies and bay % 2 == building.seed // 3 % 2:
            _balcony(sheet, x - 0.25, sill - 0.75, windows.width + 0.5)


def _balcony(sheet: Sheet, x: float, z: float, width: float) -> None:
    """Paint a slab and its railing, and the shadow under it."""
    sheet.box(x, z - 0.55, x + width, z - 0.15, (84, 82, 82))
    sheet.box(x, z - 0.15, x + width, z, (176, 174, 170))
    for bar in np.arange(x, x + width, 0.17):
        sheet.box(bar, z, bar + 0.04, z + 0.95, (58, 60, 64))
    sheet.box(x, z + 0.92, x + width, z + 1.0, (58, 60, 64))


def paint_window(
    sheet: Sheet, kind: Windows, rng: np.random.Generator, look: Look,
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
    paint_glass(sheet, rng, look, x, z, right, top)
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


def paint_glass(
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


def paint_door(
    sheet: Sheet, rng: np.random.Generator, look: Look, x: float, trim: tuple[int, int, int]
) -> None:
    """Paint a door with steps, a fanlight and a lamp beside it."""
    colours = ((92, 44, 36), (40, 62, 52), (44, 54, 80), (70, 50, 36), (128, 34, 34), (40, 42, 46))
    colour = colours[int(rng.integers(6))]
    sheet.box(x - 0.16, 0.3, x + 1.16, 2.75, trim)
    sheet.box(x, 0.3, x + 1.0, 2.3, colour)
    sheet.box(x + 0.14, 1.4, x + 0.86, 2.1, tuple(int(c * 0.72) for c in colour))
    sheet.box(x + 0.14, 0.5, x + 0.86, 1.2, tuple(int(c * 0.78) for c in colour))
    paint_glass(sheet, rng, look, x, 2.36, x + 1.0, 2.66)
    sheet.box(x - 0.3, 0.0, x + 1.3, 0.3, (150, 146, 140))
    sheet.box(x - 0.3, 0.12, x + 1.3, 0.16, (104, 102, 98))
    sheet.light(x + 1.3, 2.05, x + 1.5, 2.35, np.array([255, 214, 150]) * look.lamps)
