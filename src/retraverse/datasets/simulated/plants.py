"""Trees, bushes and hedges as see-through textures, in any season.

A tree is grown once from its seed, twigs first; leaves hang on twig ends in a fixed order, so
that falling leaves are the same leaves at any season.
"""

import math
from dataclasses import dataclass

import numpy as np

from retraverse.datasets.simulated.canvas import Texture
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.noise import blend, fractal_noise
from retraverse.datasets.simulated.things import Barrier, BarrierKind, TreeKind
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["SPRITE_ASPECT", "paint_barrier", "paint_tree"]

ROWS, COLUMNS = 432, 384
SPRITE_ASPECT = COLUMNS / ROWS
"""Width of a tree's texture as a part of its height."""

SUMMER = ((74, 104, 46), (60, 92, 44), (88, 112, 52), (66, 98, 60))
TURNED = ((206, 150, 44), (196, 112, 40), (168, 74, 40), (178, 146, 66))
SNOW = np.array([238, 242, 248], np.float32)


@dataclass(frozen=True)
class _Twig:
    """A straight piece of wood, in sprite pixels."""

    start: tuple[float, float]
    end: tuple[float, float]
    width: float
    depth: int


def paint_tree(seed: int, kind: TreeKind, look: Look) -> Texture:
    """Return a tree's sprite: RGB times alpha, and alpha; full light, the sun from the left."""
    rng = np.random.default_rng([seed, 30])
    colours = np.zeros((ROWS, COLUMNS, 3), np.uint8)
    alpha = np.zeros((ROWS, COLUMNS), np.uint8)
    if kind == "conifer":
        _conifer(colours, alpha, rng, look)
    elif kind == "bush":
        _bush(colours, alpha, rng, look)
    else:
        twigs = _grow(rng, is_slender=kind == "slender")
        _draw_wood(colours, alpha, twigs, look)
        _draw_leaves(colours, alpha, twigs, rng, look)
    return _sprite(colours, alpha)


def _sprite(colours: ImageArray, alpha: ImageArray) -> Texture:
    """Return colours and a slightly softened alpha as one texture."""
    import cv2

    grain = fractal_noise((ROWS, COLUMNS), 5, cells=32, octaves=3)
    grained = np.clip(colours * (0.72 + 0.56 * grain)[:, :, None], 0, 255).astype(np.uint8)
    soft = cv2.GaussianBlur(alpha, (3, 3), 0.7)
    # Colours are spread outwards first, so that soft edges do not turn dark.
    spread = cv2.dilate(grained, np.ones((3, 3), np.uint8))
    spread[alpha > 0] = grained[alpha > 0]
    premultiplied = cv2.multiply(spread, cv2.cvtColor(soft, cv2.COLOR_GRAY2RGB), scale=1 / 255)
    return Texture(np.dstack([premultiplied, soft]))


def _grow(rng: np.random.Generator, *, is_slender: bool) -> list[_Twig]:
    """Return the wood of a tree, trunk first."""
    lean = float(rng.normal(0, 0.04))
    trunk = float(rng.uniform(0.26, 0.34)) * ROWS
    base = (COLUMNS / 2, ROWS - 1.0)
    top = (base[0] + trunk * math.sin(lean), base[1] - trunk)
    twigs = [_Twig(base, top, 9.0, 0)]
    level = [(top, lean, trunk * 0.72, 7.0)]
    spread = 0.32 if is_slender else 0.52
    for depth in range(1, 6):
        following = []
        for start, angle, length, width in level:
            for k in range(3 if depth < 3 else 2):
                turn = (k - (1.0 if depth < 3 else 0.5)) * spread * (1.0 if depth < 3 else 1.5)
                bent = (angle + turn + float(rng.normal(0, 0.2))) * (0.8 if is_slender else 0.97)
                reach = length * float(rng.uniform(0.66, 0.96))
                end = (start[0] + reach * math.sin(bent), start[1] - reach * math.cos(bent))
                twigs.append(_Twig(start, end, width, depth))
                following.append((end, bent, reach * 0.86, width * 0.6))
        level = following
    return _fitted(twigs)


def _fitted(twigs: list[_Twig]) -> list[_Twig]:
    """Return the wood scaled to fill the sprite, foot at the middle of the lower edge."""
    points = np.array([twig.end for twig in twigs])
    high = (ROWS - 24) / max(ROWS - points[:, 1].min(), 1)
    wide = (COLUMNS / 2 - 20) / max(np.abs(points[:, 0] - COLUMNS / 2).max(), 1)

    def moved(point: tuple[float, float]) -> tuple[float, float]:
        x = COLUMNS / 2 + (point[0] - COLUMNS / 2) * min(wide, 1.5 * high)
        return x, ROWS - (ROWS - point[1]) * high

    return [_Twig(moved(t.start), moved(t.end), t.width * 1.2, t.depth) for t in twigs]


def _draw_wood(colours: ImageArray, alpha: ImageArray, twigs: list[_Twig], look: Look) -> None:
    """Draw trunk and branches, lit on the left, with snow on top of them."""
    import cv2

    for twig in twigs:
        width = max(1, round(twig.width))
        start, end = (tuple(round(v * 8) for v in point) for point in (twig.start, twig.end))
        bark = (88 - 5 * twig.depth, 74 - 5 * twig.depth, 62 - 4 * twig.depth)
        cv2.line(colours, start, end, bark, width, cv2.LINE_8, 3)
        cv2.line(alpha, start, end, 255, width, cv2.LINE_8, 3)
        up = 8 * (width // 2 + 1)
        flat = abs(end[0] - start[0]) > 0.3 * abs(end[1] - start[1])
        if look.snow > 0.2 and flat and twig.depth > 0:
            a, b = (start[0], start[1] - up), (end[0], end[1] - up)
            thick = max(1, round(look.snow * width * 0.6))
            tone = tuple(float(v) for v in SNOW * 0.96)
            cv2.line(colours, a, b, tone, thick, cv2.LINE_8, 3)
            cv2.line(alpha, a, b, 255, thick, cv2.LINE_8, 3)


def _draw_leaves(
    colours: ImageArray, alpha: ImageArray, twigs: list[_Twig], rng: np.random.Generator,
    look: Look,
) -> None:  # fmt: skip
    """Draw the leaves that are left: dark ones first, those in the light last."""
    tips = np.array([twig.end for twig in twigs if twig.depth >= 3])
    tufts = max(3, 2200 // len(tips))
    count = len(tips) * tufts
    places = np.repeat(tips, tufts, axis=0) + rng.normal(0, 17.0, (count, 2))
    sizes, order = rng.uniform(2.5, 7.0, count), rng.random(count)
    own, tint = rng.normal(0, 0.1, count), rng.integers(4)
    left = order < look.leaves
    centre, extent = tips.mean(axis=0), tips.std(axis=0) + 1
    across, down = ((places - centre) / extent).T
    light = 0.95 - 0.20 * down - 0.10 * across + own
    green = np.array(SUMMER[int(tint)], np.float32)
    turned = np.array(TURNED[int(tint)], np.float32)
    leaf = blend(green, turned, look.autumn)
    for k in np.argsort(light):
        if left[k]:
            shade = np.float32(np.clip(light[k], 0.4, 1.4))
            _blob(colours, alpha, places[k], sizes[k], leaf * shade)


def _blob(
    colours: ImageArray, alpha: ImageArray, place: FloatArray, size: float, colour: FloatArray
) -> None:
    """Draw one tuft of leaves."""
    import cv2

    at = (round(float(place[0])), round(float(place[1])))
    axes = (max(1, round(float(size))), max(1, round(float(size) * 0.7)))
    shown = tuple(float(value) for value in np.clip(colour, 0, 255))
    cv2.ellipse(colours, at, axes, float(place[0] * 7 % 180), 0, 360, shown, -1)
    cv2.ellipse(alpha, at, axes, float(place[0] * 7 % 180), 0, 360, 255, -1)


def _conifer(colours: ImageArray, alpha: ImageArray, rng: np.random.Generator, look: Look) -> None:
    """Draw a fir: drooping tufts in rows, wider below; it stays green, and snow lies on it."""
    import cv2

    middle = COLUMNS // 2
    cv2.rectangle(colours, (middle - 7, ROWS - 44), (middle + 7, ROWS), (74, 60, 50), -1)
    cv2.rectangle(alpha, (middle - 7, ROWS - 44), (middle + 7, ROWS), 255, -1)
    green = np.array([40, 70, 46], np.float32) * np.float32(rng.uniform(0.85, 1.25))
    reach = float(rng.uniform(84, 128))
    for row in range(ROWS - 36, 14, -8):
        half = reach * (row / ROWS) ** 1.1 * float(rng.uniform(0.8, 1.1))
        for x in np.linspace(-half, half, max(2, int(half / 4.5))):
            drop = 0.22 * abs(x) + float(rng.normal(0, 2))
            shade = 0.85 - 0.3 * x / reach * 0.5 + float(rng.normal(0, 0.14))
            is_white = rng.random() < look.snow * 0.72
            tuft = SNOW * np.float32(0.93) if is_white else green * np.float32(max(shade, 0.3))
            _blob(colours, alpha, np.array([middle + x, row + drop]), 8.0, tuft)


def _bush(colours: ImageArray, alpha: ImageArray, rng: np.random.Generator, look: Look) -> None:
    """Draw a round bush; it thins to twigs in winter, with snow on top."""
    import cv2

    base, count = (COLUMNS // 2, ROWS - 1), 520
    angles, radii = rng.uniform(-1.45, 1.45, count), np.sqrt(rng.random(count))
    places = np.stack(
        [base[0] + np.sin(angles) * radii * 165, base[1] - np.cos(angles) * radii * 380], axis=1
    )
    for place in places[::5]:
        end = (round(float(place[0])), round(float(place[1])))
        cv2.line(colours, base, end, (78, 66, 58), 3)
        cv2.line(alpha, base, end, 255, 3)
    is_evergreen, order = rng.random() < 0.5, rng.random(count)
    green = np.array(SUMMER[int(rng.integers(4))], np.float32)
    brown = np.array(TURNED[int(rng.integers(4))], np.float32)
    leaf = green if is_evergreen else blend(green, brown, look.autumn)
    light = 0.6 + 0.5 * radii * np.cos(angles) - 0.08 * np.sin(angles) + rng.normal(0, 0.1, count)
    for k in np.argsort(light):
        if is_evergreen or order[k] < look.leaves:
            _blob(colours, alpha, places[k], 13.0, leaf * np.float32(np.clip(light[k], 0.35, 1.4)))
        elif light[k] > 0.95 and order[k] < look.snow:
            _blob(colours, alpha, places[k], 11.0, SNOW * np.float32(0.9))
    if is_evergreen and look.snow > 0:
        for k in np.flatnonzero((light > 0.9) & (order < look.snow)):
            _blob(colours, alpha, places[k], 11.0, SNOW * np.float32(0.93))


def paint_barrier(barrier: Barrier, look: Look) -> Texture:
    """Return a hedge, fence, wall or railing as a texture, snow on top."""
    px = 24
    length = min(barrier.end_m - barrier.start_m, 24.0)
    rows, columns = max(8, round(barrier.height_m * px)), max(8, round(length * px))
    colours, alpha = _barrier_body(barrier.kind, (rows, columns), barrier, look)
    cap = round(0.13 * px * look.snow)
    if cap > 0 and barrier.kind != "railing":
        colours[:cap][alpha[:cap] > 0] = SNOW
    colours[-max(2, rows // 6) :] *= np.float32(0.72)
    whole = np.clip(colours * (alpha[:, :, None] / np.float32(255)), 0, 255).astype(np.uint8)
    return Texture(np.dstack([whole, alpha]))


def _barrier_body(
    kind: BarrierKind, shape: tuple[int, int], barrier: Barrier, look: Look
) -> tuple[Array, ImageArray]:
    """Return the colours and the alpha of a barrier without snow."""
    rows, columns = shape
    alpha = np.full(shape, 255, np.uint8)
    tile = fractal_noise((256, 256), 9, cells=32, octaves=3)
    repeats = (rows // 256 + 1, columns // 256 + 1)
    grain = np.tile(tile, repeats)[:rows, :columns, None]
    if kind == "hedge":
        bare = blend(np.array(SUMMER[barrier.seed % 4], np.float32),
                     np.array([112, 92, 70], np.float32), 0.8 * look.autumn)  # fmt: skip
        ragged = (tile[0, np.arange(columns) % 256] * 6).astype(int)
        alpha[np.arange(rows)[:, None] < ragged[None]] = 0
        return (0.35 + 1.1 * grain) * bare * np.linspace(1.15, 0.75, rows)[:, None, None], alpha
    if kind == "wall":
        courses = np.where(np.arange(rows) % 5 == 0, 0.8, 1.0)[:, None, None]
        body = (0.8 + 0.35 * grain) * courses * np.array(barrier.colour, np.float32)
        body[: max(2, rows // 10)] = np.array([170, 166, 160]) * 0.95
        return body, alpha
    period, bar = (6, 3) if kind == "pickets" else (5, 1)
    is_bar = np.arange(columns) % period < bar
    is_rail = np.isin(np.arange(rows) * 8 // rows, (1, 6))
    alpha[:] = np.where(is_bar[None] | is_rail[:, None], 255, 0)
    tone = np.array(barrier.colour if kind == "pickets" else (52, 56, 58), np.float32)
    return (0.85 + 0.2 * grain) * tone, alpha
