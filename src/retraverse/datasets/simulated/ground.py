"""The ground: road with markings and kerbs, pavements and plots, with light, grain and snow.

Flat bands are filled first, exactly along the curve. Then light, shadows, grain and snow are
multiplied in: these lie in a map over (s, d) that is baked stretch by stretch and looked up
for every ground pixel.
"""

import math
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.camera import Points, View
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
UNIT = 120.0
"""Value of light 1.0 in the baked map."""

ROAD = np.array([98, 98, 101], np.float32)
COLOURS = {
    "grass": np.array([98, 116, 66], np.float32),
    "paving": np.array([150, 145, 137], np.float32),
    "asphalt": np.array([108, 107, 108], np.float32),
}
PAINT = np.array([214, 214, 208], np.float32)


class GroundPainter:
    """Paints the ground of one street under one look."""

    def __init__(self, street: Street, look: Look) -> None:
        self.street, self.look = street, look
        self._baked = lru_cache(maxsize=16)(self._bake)

    def paint(self, canvas: Canvas) -> None:
        """Fill everything below the horizon."""
        view = canvas.view
        top = max(0, math.ceil(view.centre[1] + 0.2))
        canvas.pixels[top:] = np.clip(COLOURS["grass"] * 0.9, 0, 255).astype(np.uint8)
        self._bands(canvas)
        self._markings(canvas)
        self._finish(canvas, top)

    def _line(self, view: View, s: Metres, d: float) -> Points:
        return view.to_camera(self.street.line.points(s, d))

    def _bands(self, canvas: Canvas) -> None:
        """Fill plots, pavements, kerbs and road."""
        view, position = canvas.view, canvas.view.position_m
        s = position + np.concatenate([np.linspace(-6, 6, 13), np.geomspace(7, VIEW_M, 34)])
        for ground in self.street.grounds_between(position - 4, position + VIEW_M):
            if ground.front_m >= FRONT_M:
                self._plot(canvas, ground, 60.0)
        dry = np.float32(1.0 - 0.3 * self.look.wet)
        pavement, kerb = COLOURS["paving"] * dry, np.array([176, 172, 166], np.float32) * dry
        for side in (-1, 1):
            inner, outer = self._line(view, s, side * KERB_M), self._line(view, s, side * FRONT_M)
            canvas.strip(inner, outer, pavement)
            canvas.strip(inner, self._line(view, s, side * (KERB_M + 0.16)), kerb)
        for ground in self.street.grounds_between(position - 4, position + VIEW_M):
            if ground.front_m < FRONT_M:
                self._plot(canvas, ground, 70.0)
        edges = [self._line(view, s, side * KERB_M) for side in (-1, 1)]
        canvas.strip(edges[0], edges[1], ROAD * np.float32(1.0 - 0.35 * self.look.wet))
        for side, edge in zip((-1, 1), edges, strict=True):
            canvas.strip(edge, self._line(view, s, side * (KERB_M - 0.14)), ROAD * np.float32(0.62))

    def _plot(self, canvas: Canvas, ground: Ground, reach_m: float) -> None:
        start = max(ground.start_m, canvas.view.position_m - 6)
        end = min(ground.end_m, canvas.view.position_m + VIEW_M)
        s = np.linspace(start, end, 5 if start < canvas.view.position_m + 20 else 2)
        near, far = (self._line(canvas.view, s, ground.side * d) for d in (ground.front_m, reach_m))
        canvas.polygon(np.concatenate([near, far[::-1]]), COLOURS[ground.kind], haze=0.0)

    def _markings(self, canvas: Canvas) -> None:
        """Fill lane dashes, parking lines, repairs, covers, and crossings at side streets."""
        position = canvas.view.position_m
        faded = PAINT * np.float32(1.0 - 0.25 * self.look.wet)
        for k in range(math.floor(position / 9), math.floor((position + 110) / 9) + 1):
            self._patch(canvas, k * 9.0, k * 9.0 + 3.4, -0.07, 0.07, faded)
            self._repair(canvas, k)
        for k in range(math.floor(position / 6.4), math.floor((position + 60) / 6.4) + 1):
            for side in (-1, 1):
                edge = side * (LANE_M + 0.12)
                self._patch(canvas, k * 6.4 - 3.2, k * 6.4 - 1.6, edge - 0.05, edge + 0.05, faded)
        for ground in self.street.grounds_between(position - 8, position + 90):
            if ground.front_m < FRONT_M and ground.side > 0:
                for stripe in range(9):
                    d = -KERB_M + 0.5 + stripe * 1.18
                    self._patch(
                        canvas, ground.start_m - 4.5, ground.start_m - 1.7, d, d + 0.55, faded
                    )

    def _repair(self, canvas: Canvas, k: int) -> None:
        """Fill a patch of newer asphalt or an iron cover in some places."""
        rng = np.random.default_rng([self.street.seed, 60, k + 64])
        draw, start, d = rng.random(), k * 9.0 + float(rng.uniform(0, 6)), float(rng.uniform(-4, 3))
        if draw < 0.3:
            tone = ROAD * np.float32(rng.choice([0.72, 0.8, 1.14]))
            self._patch(canvas, start, start + float(rng.uniform(1.5, 6)), d,
                        d + float(rng.uniform(0.7, 2.4)), tone)  # fmt: skip
        elif draw < 0.5:
            turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
            rim = self.street.line.points(start + 0.36 * np.sin(turn), d + 0.36 * np.cos(turn))
            canvas.polygon(canvas.view.to_camera(rim), ROAD * np.float32(0.5), haze=0.0)

    def _patch(
        self, canvas: Canvas, s0: float, s1: float, d0: float, d1: float, colour: FloatArray
    ) -> None:
        corners = self.street.line.points(np.array([s0, s1, s1, s0]), np.array([d0, d0, d1, d1]))
        canvas.polygon(canvas.view.to_camera(corners), colour, haze=0.0)

    def _finish(self, canvas: Canvas, top: int) -> None:
        """Multiply in light and grain, lay snow, add headlights and haze."""
        import cv2

        below = canvas.pixels[top:]
        depth = _row_depths(canvas.view, top, len(below))
        s, d = self._places(canvas.view, depth, below.shape[1])
        baked = self._lookup(s, d, depth, canvas.view.position_m)
        light = cv2.cvtColor(baked, cv2.COLOR_RGBA2RGB)
        if self.look.snow > 0:
            weight = baked[:, :, 3].astype(np.float32) / 255
            snow = np.full_like(below, 238)
            snow[:, :, 2] = 246
            below[:] = cv2.blendLinear(below, snow, 1 - weight, weight)
        shone = cv2.multiply(below, light, scale=1 / UNIT)
        shone = cv2.multiply(shone, _grain(s, d, depth), scale=1 / 128)
        if self.look.lamps > 0:
            shone = cv2.add(shone, _headlights(canvas.view, depth, below, self.look.lamps))
        haze = 1.0 - np.exp(-depth / self.look.sight_m)
        weight = np.ascontiguousarray(np.broadcast_to(haze[:, None], s.shape), np.float32)
        cover = np.empty_like(below)
        cover[:] = np.clip(self.look.haze, 0, 255).astype(np.uint8)
        below[:] = cv2.blendLinear(shone, cover, 1 - weight, weight)

    def _places(self, view: View, depth: FloatArray, width: int) -> tuple[FloatArray, FloatArray]:
        """Return where on the street every ground pixel lies: s and d, metres."""
        line = self.street.line
        along = view.position_m + np.linspace(-4, 320, 325)
        centre = view.to_camera(line.points(along, 0.0))
        ahead = np.maximum.accumulate(centre[:, 2])
        s_row = np.interp(depth, ahead, along)
        x_row = np.interp(depth, ahead, centre[:, 0])
        turn = view.heading - line.heading_at(s_row)
        columns = (np.arange(width) + 0.5 - view.centre[0]) / view.camera.focal
        right = depth[:, None] * columns[None].astype(np.float32) - x_row[:, None]
        s = s_row[:, None] + right * np.sin(turn)[:, None]
        return s.astype(np.float32), (right * np.cos(turn)[:, None]).astype(np.float32)

    def _lookup(
        self, s: FloatArray, d: FloatArray, depth: FloatArray, position_m: float
    ) -> ImageArray:
        """Return the baked light and snow at every ground pixel, uint8 (rows, columns, 4)."""
        import cv2

        first = math.floor((position_m - 24) / STRETCH_M)
        count = math.ceil((VIEW_M + 80) / STRETCH_M)
        baked = np.concatenate([self._baked(first + k) for k in range(count)])
        rows = (s - np.float32(first * STRETCH_M)) * np.float32(PER_S) - np.float32(0.5)
        columns = (d + np.float32(HALF_M)) * np.float32(PER_D) - np.float32(0.5)
        split = int(np.searchsorted(-depth, -26.0))
        result = np.empty((*s.shape, 4), np.uint8)
        half = cv2.resize(baked, None, fx=0.25, fy=0.5, interpolation=cv2.INTER_AREA)
        for part, texture, fx, fy in (
            (slice(0, split), half, 0.25, 0.5),
            (slice(split, None), baked, 1.0, 1.0),
        ):
            if len(rows[part]):
                result[part] = cv2.remap(
                    texture, columns[part] * np.float32(fx), rows[part] * np.float32(fy),
                    cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE,
                )  # fmt: skip
        return result

    def _bake(self, stretch: int) -> ImageArray:
        """Return light (three channels, 120 = 1.0) and snow cover of one stretch."""
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
        baked = np.concatenate([light * UNIT, snow[:, :, None] * 255], axis=2)
        return np.clip(baked, 0, 255).astype(np.uint8)

    def _shadows(self, start: float) -> FloatArray:
        """Return how much of the sun houses and trees take away, (rows, columns) in 0..1."""
        import cv2

        mask = np.zeros((STRETCH_M * PER_S, round(2 * HALF_M * PER_D)), np.uint8)
        along, right = sun_along(self.street, start + STRETCH_M / 2)
        reach = 1.0 / math.tan(SUN_ELEVATION)

        def cells(points: list[tuple[float, float]]) -> np.ndarray:
            at = [((d + HALF_M) * PER_D * 16, (s - start) * PER_S * 16) for s, d in points]
            return np.round(np.array(at)).astype(np.int32)

        for thing in self.street.things_between(start - 40, start + STRETCH_M + 60):
            if isinstance(thing, Building) and not thing.is_backdrop:
                high = thing.eaves_m + 0.5 * thing.roof_m
                front = thing.side * thing.front_m
                ds, dd = -high * reach * along, -high * reach * right
                if dd * thing.side < 0:
                    corners = [(thing.start_m, front), (thing.end_m, front),
                               (thing.end_m + ds, front + dd), (thing.start_m + ds, front + dd)]  # fmt: skip
                    cv2.fillConvexPoly(mask, cells(corners), 225, shift=4)
            elif isinstance(thing, Tree):
                self._tree_shadow(mask, thing, cells, (along * reach, right * reach))
        return np.asarray(cv2.GaussianBlur(mask, (0, 0), 1.6), np.float32) / 255

    def _tree_shadow(
        self, mask: ImageArray, tree: Tree, cells: object, reach: tuple[float, float]
    ) -> None:
        """Add the ragged shadow of a crown."""
        import cv2

        rng = np.random.default_rng([tree.seed, 61])
        tone = 70 + 130 * self.look.leaves
        middle = (tree.key_m - 0.6 * tree.height_m * reach[0],
                  tree.lateral_m - 0.6 * tree.height_m * reach[1])  # fmt: skip
        assert callable(cells)
        for _ in range(14):
            s, d = np.array(middle) + rng.normal(0, 0.17 * tree.height_m, 2)
            at = cells([(float(s), float(d))])[0]
            size = (round(0.11 * tree.height_m * PER_D * 16), round(0.11 * tree.height_m * PER_S * 16))
            turn = np.linspace(0, 2 * np.pi, 10, endpoint=False)
            ring = at + np.stack([np.cos(turn) * size[0], np.sin(turn) * size[1]], axis=1)
            cv2.fillConvexPoly(mask, np.round(ring).astype(np.int32), tone, shift=4)


def _row_depths(view: View, top: int, rows: int) -> FloatArray:
    """Return the depth in metres of the ground in each row from `top` on."""
    below = np.arange(top, top + rows) + 0.5 - view.centre[1]
    depth = view.camera.focal * view.camera.height_m / np.maximum(below, 0.4)
    return np.minimum(depth, 320.0).astype(np.float32)


def _wear(d: Metres) -> FloatArray:
    """Return the tone of the road across: darker oil line, lighter wheel tracks."""
    lane = np.abs(np.abs(d) - LANE_M / 2)
    tone = 1.0 - 0.07 * np.exp(-((lane / 0.3) ** 2)) + 0.05 * np.exp(-(((lane - 0.75) / 0.25) ** 2))
    edge = 1.0 - 0.16 * np.exp(-(((np.abs(d) - KERB_M) / 0.5) ** 2))
    return np.where(np.abs(d) < KERB_M, tone * edge, 1.0).astype(np.float32)


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
    return np.clip((1.1 * depth * snow - noise) * 4, 0, 0.95).astype(np.float32)


def _grain(s: FloatArray, d: FloatArray, depth: FloatArray) -> ImageArray:
    """Return the surface's grain at every ground pixel, 128 = none, three equal channels."""
    import cv2

    fine = _grain_tile()
    near = cv2.remap(fine, d * np.float32(40), s * np.float32(20), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_WRAP)  # fmt: skip
    strength = np.clip(1.25 - depth / 22, 0.0, 1.0)[:, None].astype(np.float32)
    toned = (near.astype(np.float32) - 128) * strength + 128
    return np.asarray(cv2.cvtColor(toned.astype(np.uint8), cv2.COLOR_GRAY2RGB))


@lru_cache(maxsize=1)
def _grain_tile() -> ImageArray:
    fine = fractal_noise((512, 512), 70, cells=64, octaves=3)
    broad = fractal_noise((512, 512), 72, cells=3, octaves=4)
    grey = 128 + 44 * (fine - fine.mean()) + 44 * (broad - broad.mean())
    return np.clip(grey, 0, 255).astype(np.uint8)


def _headlights(view: View, depth: FloatArray, below: ImageArray, strength: float) -> ImageArray:
    """Return the light that the car's own headlights throw back from the road."""
    import cv2

    columns = (np.arange(below.shape[1], dtype=np.float32) + 0.5 - view.centre[0]) / view.camera.focal
    cone = np.exp(-((columns[None] / 0.42) ** 2)) * np.exp(-depth[:, None] / 13)
    cone = cone * np.clip((depth[:, None] - 2.0) / 4.0, 0.15, 1.0) * np.float32(0.62 * strength)
    weight = cv2.cvtColor(np.clip(cone * 255, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2RGB)
    return np.asarray(cv2.multiply(below, weight, scale=1 / 255))
