"""The ground: road with markings and kerbs, pavements and plots, with light, grain and snow.

Flat bands are filled first, exactly along the curve. Then light, shadows, grain and snow are
multiplied in: these lie in a map over (s, d) that is baked stretch by stretch and looked up
for every ground pixel.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from retraverse.datasets.simulated.camera import View
from retraverse.datasets.simulated.canvas import Canvas
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.lighting import SUN_ELEVATION, lamp_light, sun_along
from retraverse.datasets.simulated.noise import fractal_noise
from retraverse.datasets.simulated.path import Metres
from retraverse.datasets.simulated.street import FRONT_M, KERB_M, LANE_M, VIEW_M, Street
from retraverse.datasets.simulated.things import Building, Ground, Tree
from retraverse.types import FloatArray, ImageArray

__all__ = ["GroundPainter"]

STRETCH_M = 32
PER_S, PER_D = 4, 8
"""Cells a metre along and across in the baked map."""
HALF_M = 26.0
PERIOD_M = 9.0
"""From one lane dash to the next."""
PLOT_M = 65.0
"""How far plots reach from the centre line."""
CROSSING_D = [-KERB_M + 0.5 + 1.18 * stripe for stripe in range(9)]

ROAD = np.array([118, 118, 120], np.float32)
KERB = np.array([206, 202, 194], np.float32)
SNOW = np.array([238, 240, 246], np.float32)
COLOURS = {
    "grass": np.array([98, 118, 66], np.float32),
    "paving": np.array([176, 170, 160], np.float32),
    "asphalt": np.array([126, 125, 125], np.float32),
}
PAINT = np.array([214, 214, 208], np.float32)

Patch = tuple[tuple[float, float, float, float], FloatArray]
"""Start and end along the street, left and right across it, and a colour."""
Cells = Callable[[list[tuple[float, float]]], NDArray[np.int32]]
"""From places (s, d) to cells of the baked map, in sixteenths."""


class GroundPainter:
    """Paints the ground of one street under one look."""

    def __init__(self, street: Street, look: Look) -> None:
        self.street, self.look = street, look
        self._baked = lru_cache(maxsize=32)(self._bake)
        self._repairs = lru_cache(maxsize=256)(self._make_repairs)

    def paint(self, canvas: Canvas) -> None:
        """Fill everything below the horizon."""
        view = canvas.view
        step = view.camera.supersampling
        top = max(0, math.floor(view.centre[1] / step) * step)
        _fill(canvas.pixels[top:], COLOURS["grass"])
        self._bands(canvas)
        self._markings(canvas)
        self._finish(canvas, top)

    def _bands(self, canvas: Canvas) -> None:
        """Fill plots, pavements, kerbs, side streets and road, in this order."""
        view, position = canvas.view, canvas.view.position_m
        grounds = self.street.grounds_between(position, position + VIEW_M)
        self._plots(canvas, [ground for ground in grounds if ground.front_m >= FRONT_M])
        s = position + np.concatenate([np.linspace(-4, 6, 11), np.geomspace(7, VIEW_M, 24)])
        across = np.array([KERB_M - 0.14, KERB_M, KERB_M + 0.16, FRONT_M])
        d = np.concatenate([-across, across])
        lines = view.to_camera(self.street.line.points(s[None], d[:, None]))
        dry = np.float32(1.0 - 0.3 * self.look.wet)
        for side in (0, 4):
            canvas.strip(lines[side + 1], lines[side + 3], COLOURS["paving"] * dry)
            canvas.strip(lines[side + 1], lines[side + 2], KERB * dry)
        self._plots(canvas, [ground for ground in grounds if ground.front_m < FRONT_M])
        canvas.strip(lines[1], lines[5], ROAD * np.float32(0.62))
        canvas.strip(lines[0], lines[4], ROAD * np.float32(1.0 - 0.35 * self.look.wet))

    def _plots(self, canvas: Canvas, grounds: list[Ground]) -> None:
        """Fill plots from their front outwards, from where they come into view."""
        if not grounds:
            return
        position = canvas.view.position_m
        ends = np.clip([(g.start_m, g.end_m) for g in grounds], position + 2.5, position + VIEW_M)
        reach = np.array([g.side * np.array([g.front_m, PLOT_M]) for g in grounds])
        s, d = ends[:, [0, 1, 1, 0]], reach[:, [0, 0, 1, 1]]
        corners = canvas.view.to_camera(self.street.line.points(s, d))
        canvas.patches(corners, np.array([COLOURS[ground.kind] for ground in grounds]))

    def _markings(self, canvas: Canvas) -> None:
        """Fill repairs, lane dashes, parking lines, and crossings at side streets."""
        position = canvas.view.position_m
        first = math.floor(position / PERIOD_M)
        patches = [patch for k in range(first, first + 12) for patch in self._repairs(k)]
        faded = PAINT * np.float32(1.0 - 0.25 * self.look.wet)
        boxes = [(k * PERIOD_M, k * PERIOD_M + 3.4, -0.07, 0.07) for k in range(first, first + 13)]
        first = math.floor(position / 6.4)
        for edge in (-LANE_M - 0.17, LANE_M + 0.07):
            boxes += [(k * 6.4 - 3.2, k * 6.4 - 1.6, edge, edge + 0.1)
                      for k in range(first, first + 11)]  # fmt: skip
        for ground in self.street.grounds_between(position - 8, position + 90):
            if ground.front_m < FRONT_M and ground.side > 0:
                start = ground.start_m - 4.5
                boxes += [(start, start + 2.8, d, d + 0.55) for d in CROSSING_D]
        patches += [(box, faded) for box in boxes]
        corners = np.array([box for box, _ in patches])[:, [[0, 2], [1, 2], [1, 3], [0, 3]]]
        world = self.street.line.points(corners[..., 0].ravel(), corners[..., 1].ravel())
        spots = canvas.view.to_camera(world).reshape(-1, 4, 3)
        canvas.patches(spots, np.array([colour for _, colour in patches]))

    def _make_repairs(self, k: int) -> list[Patch]:
        """Return a patch of newer asphalt, or a cover, in some places."""
        rng = np.random.default_rng([self.street.seed, 60, k + 64])
        draw, d = rng.random(), float(rng.uniform(-4, 3))
        start = k * PERIOD_M + float(rng.uniform(0, 6))
        if draw < 0.3:
            tone = ROAD * np.float32(rng.choice([0.78, 0.84, 1.12]))
            size = float(rng.uniform(1.5, 6)), float(rng.uniform(0.7, 2.4))
            return [((start, start + size[0], d, d + size[1]), tone)]
        if draw < 0.55:
            rim, iron = ROAD * np.float32(0.8), ROAD * np.float32(0.5)
            return [((start - 0.06, start + 0.66, d - 0.06, d + 0.66), rim),
                    ((start, start + 0.6, d, d + 0.6), iron)]  # fmt: skip
        return []

    def _finish(self, canvas: Canvas, top: int) -> None:
        """Multiply in light and grain, lay snow, add headlights and haze.

        Worked out at the camera's own size: what is painted over it later needs the smooth
        edges of the enlarged picture, the ground beneath does not.
        """
        import cv2

        below = canvas.pixels[top:]
        step = canvas.view.camera.supersampling
        rows, columns = len(below) // step, below.shape[1] // step
        small = cv2.resize(below, (columns, rows), interpolation=cv2.INTER_AREA)
        depth, s, d = self._places(canvas.view, top, rows, step)
        baked = self._lookup(s, d, depth, canvas.view.position_m)
        gain = baked[:, :, :3] * _grain(s, d, depth)[:, :, None]
        if self.look.lamps > 0:
            gain += self.look.lamps * _headlights(canvas.view, depth, columns, step)
        if self.look.snow > 0:
            cover = baked[:, :, 3:]
            shone = (small + cover * (SNOW - small)) * gain
        else:
            shone = small * gain
        shone += (1 - np.exp(-depth / self.look.sight_m))[:, None, None] * (self.look.haze - shone)
        size = (below.shape[1], below.shape[0])
        whole = cv2.convertScaleAbs(shone)
        cv2.resize(whole, size, dst=below, interpolation=cv2.INTER_NEAREST)

    def _places(
        self, view: View, top: int, count: int, step: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where ground pixels lie: depth by row, s and d by row and column, metres."""
        line, focal = self.street.line, view.camera.focal
        width = view.camera.canvas[1] // step
        row = top + (np.arange(count) + 0.5) * step - view.centre[1]
        depth = np.minimum(focal * view.camera.height_m / np.maximum(row, 0.4), 320.0)
        along = view.position_m + np.linspace(-4, 330, 168)
        centre = view.to_camera(line.points(along, 0.0))
        ahead = np.maximum.accumulate(centre[:, 2])
        s_row = np.interp(depth, ahead, along)
        x_row = np.interp(depth, ahead, centre[:, 0])
        turn = view.heading - line.heading_at(s_row)
        columns = ((np.arange(width) + 0.5) * step - view.centre[0]) / focal
        right = np.outer(depth, columns) - x_row[:, None]
        s = s_row[:, None] + right * np.sin(turn)[:, None]
        d = right * np.cos(turn)[:, None]
        return depth.astype(np.float32), s.astype(np.float32), d.astype(np.float32)

    def _lookup(
        self, s: FloatArray, d: FloatArray, depth: FloatArray, position_m: float
    ) -> FloatArray:
        """Return the baked light and snow at every ground pixel, float32 (rows, columns, 4)."""
        import cv2

        first = math.floor((position_m - 24) / STRETCH_M)
        near, far = (
            np.concatenate([self._baked(first + k)[level] for k in range(count)])
            for level, count in ((0, 3), (1, math.ceil((VIEW_M + 80) / STRETCH_M)))
        )
        rows = (s - np.float32(first * STRETCH_M)) * np.float32(PER_S)
        columns = (d + np.float32(HALF_M)) * np.float32(PER_D)
        split = int(np.searchsorted(-depth, -26.0))
        result = np.empty((*s.shape, 4), np.float32)
        for part, baked, fx, fy in (
            (slice(0, split), far, 0.25, 0.5), (slice(split, None), near, 1.0, 1.0),
        ):  # fmt: skip
            if len(rows[part]):
                x, y = columns[part] * np.float32(fx), rows[part] * np.float32(fy)
                result[part] = cv2.remap(
                    baked, x - np.float32(0.5), y - np.float32(0.5), cv2.INTER_LINEAR,
                    borderMode=cv2.BORDER_REPLICATE,
                )  # fmt: skip
        return result

    def _bake(self, stretch: int) -> tuple[FloatArray, FloatArray]:
        """Return light (three channels) and snow cover of one stretch, fine and coarse."""
        import cv2

        start = float(stretch * STRETCH_M)
        s = start + (np.arange(STRETCH_M * PER_S) + 0.5)[:, None] / PER_S
        d = (np.arange(round(2 * HALF_M * PER_D)) + 0.5)[None] / PER_D - HALF_M
        shadow = self._shadows(start)
        light = self.look.ambient + (1 - shadow)[:, :, None] * self.look.sun * np.float32(0.8)
        light = light * _wear(d)[:, :, None]
        if self.look.lamps > 0:
            lamps = self.street.lamps_near(start + STRETCH_M / 2, 48.0)
            light = light + lamp_light(lamps, s, d, np.array(0.0), 20.0 * self.look.lamps)
        snow = _snow_cover(s, d, self.look.snow)
        fine = np.concatenate([light, snow[:, :, None]], axis=2).astype(np.float32)
        coarse = cv2.resize(fine, None, fx=0.25, fy=0.5, interpolation=cv2.INTER_AREA)
        return fine, np.asarray(coarse, np.float32)

    def _shadows(self, start: float) -> FloatArray:
        """Return how much of the sun houses and trees take away, (rows, columns) in 0..1."""
        import cv2

        mask = np.zeros((STRETCH_M * PER_S, round(2 * HALF_M * PER_D)), np.uint8)
        along, right = sun_along(self.street, start + STRETCH_M / 2)
        reach = 1.0 / math.tan(SUN_ELEVATION)

        def cells(points: list[tuple[float, float]]) -> NDArray[np.int32]:
            at = [((d + HALF_M) * PER_D * 16, (s - start) * PER_S * 16) for s, d in points]
            return np.round(np.array(at)).astype(np.int32)

        for thing in self.street.things_between(start - 40, start + STRETCH_M + 60):
            if isinstance(thing, Building) and not thing.is_backdrop:
                high = thing.eaves_m + 0.5 * thing.roof_m
                front = thing.side * thing.front_m
                ds, dd = -high * reach * along, -high * reach * right
                if dd * thing.side < 0:
                    corners = [(thing.start_m, front), (thing.end_m, front),
                               (thing.end_m + ds, front + dd),
                               (thing.start_m + ds, front + dd)]  # fmt: skip
                    cv2.fillConvexPoly(mask, cells(corners), 225, shift=4)
            elif isinstance(thing, Tree):
                self._tree_shadow(mask, thing, cells, (along * reach, right * reach))
        return np.asarray(cv2.GaussianBlur(mask, (0, 0), 1.6), np.float32) / np.float32(255)

    def _tree_shadow(
        self, mask: ImageArray, tree: Tree, cells: Cells, reach: tuple[float, float]
    ) -> None:
        """Add the ragged shadow of a crown."""
        import cv2

        rng = np.random.default_rng([tree.seed, 61])
        tone = 70 + 130 * self.look.leaves
        middle = (tree.key_m - 0.6 * tree.height_m * reach[0],
                  tree.lateral_m - 0.6 * tree.height_m * reach[1])  # fmt: skip
        for _ in range(14):
            s, d = np.array(middle) + rng.normal(0, 0.17 * tree.height_m, 2)
            at = cells([(float(s), float(d))])[0]
            size = [
                round(0.11 * tree.height_m * cells_a_metre * 16) for cells_a_metre in (PER_D, PER_S)
            ]
            turn = np.linspace(0, 2 * np.pi, 10, endpoint=False)
            ring = at + np.stack([np.cos(turn) * size[0], np.sin(turn) * size[1]], axis=1)
            cv2.fillConvexPoly(mask, np.round(ring).astype(np.int32), tone, shift=4)


def _wear(d: Metres) -> FloatArray:
    """Return the tone of the road across: darker oil line, lighter wheel tracks."""
    lane = np.abs(np.abs(d) - LANE_M / 2)
    tone = 1.0 - 0.07 * np.exp(-((lane / 0.3) ** 2)) + 0.05 * np.exp(-(((lane - 0.75) / 0.25) ** 2))
    edge = 1.0 - 0.16 * np.exp(-(((np.abs(d) - KERB_M) / 0.5) ** 2))
    return np.asarray(np.where(np.abs(d) < KERB_M, tone * edge, 1.0), np.float32)


def _snow_cover(s: Metres, d: Metres, snow: float) -> FloatArray:
    """Return how much of each place snow covers: least in the wheel tracks, most on plots."""
    if snow <= 0:
        return np.zeros(np.broadcast(s, d).shape, np.float32)
    lane = np.abs(np.abs(d) - LANE_M / 2)
    away = np.abs(d)
    depth = np.interp(away, [0, LANE_M, KERB_M - 0.4, KERB_M + 0.2, FRONT_M, FRONT_M + 1],
                      [0.62, 0.7, 1.0, 0.95, 0.9, 1.3])  # fmt: skip
    depth = depth - 0.5 * np.exp(-(((lane - 0.75) / 0.3) ** 2)) * (away < LANE_M)
    field = fractal_noise((512, 512), 71, cells=12, octaves=5)
    noise = field[(s * 9).astype(int) % 512, (d * 14).astype(int) % 512]
    return np.asarray(np.clip((1.1 * depth * snow - noise) * 4, 0, 0.95), np.float32)


def _grain(s: FloatArray, d: FloatArray, depth: FloatArray) -> FloatArray:
    """Return the surface's grain at every ground pixel, around 1.0; none far away."""
    import cv2

    grain = cv2.remap(_grain_tile(), d * np.float32(40), s * np.float32(20), cv2.INTER_LINEAR,
                      borderMode=cv2.BORDER_WRAP)  # fmt: skip
    strength = np.clip(1.25 - depth / 22, 0.0, 1.0)[:, None]
    return np.asarray(1.0 + grain * strength, np.float32)


@lru_cache(maxsize=1)
def _grain_tile() -> FloatArray:
    fine = fractal_noise((512, 512), 70, cells=64, octaves=3)
    broad = fractal_noise((512, 512), 72, cells=3, octaves=4)
    return np.asarray(0.34 * (fine - fine.mean()) + 0.09 * (broad - broad.mean()), np.float32)


def _headlights(view: View, depth: FloatArray, width: int, step: int) -> FloatArray:
    """Return the light of the car's own headlights on the road, float32 (rows, columns, 1)."""
    columns = ((np.arange(width) + 0.5) * step - view.centre[0]) / view.camera.focal
    reach = np.exp(-depth / 13) * np.clip((depth - 2.0) / 4.0, 0.15, 1.0)
    cone = np.outer(reach, np.exp(-((columns / 0.42) ** 2))) * 0.62
    return np.asarray(cone[:, :, None], np.float32)


def _fill(pixels: ImageArray, colour: FloatArray) -> None:
    """Fill a picture with one colour (much faster than broadcasting)."""
    import cv2

    corner = (pixels.shape[1] - 1, pixels.shape[0] - 1)
    cv2.rectangle(pixels, (0, 0), corner, [float(value) for value in colour], -1)
