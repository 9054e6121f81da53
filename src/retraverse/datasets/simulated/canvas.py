"""Drawing in perspective: textured panels, flat polygons and glows on an enlarged picture.

A *panel* is a flat rectangle in space with a texture on it (a wall, a roof, a tree's sprite).
Its texture comes in halved sizes along each axis, so that far and slanted panels do not
flicker; long panels are cut in two, so that each part finds its own size.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from retraverse.datasets.simulated.camera import NEAR_M, Points, View
from retraverse.datasets.simulated.conditions import Look
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["FULL", "Canvas", "Point", "Texture"]

Point = tuple[float, float]
FULL: list[Point] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
"""Outline of a panel that is all there, in texture parts (across, down)."""

SHIFT = 4
"""Bits after the point in polygon corners."""


@dataclass
class Texture:
    """Pixels of a panel, RGB, or RGB times alpha with alpha as the fourth channel."""

    pixels: ImageArray
    outline: list[Point] = field(default_factory=lambda: FULL)
    """Convex outline in parts of width and height, for gables."""
    _levels: dict[tuple[int, int], ImageArray] = field(default_factory=dict, repr=False)

    @property
    def has_alpha(self) -> bool:
        """Whether parts of it are see-through."""
        return bool(self.pixels.shape[2] == 4)

    def level(self, across: int, down: int) -> ImageArray:
        """Return the pixels, halved `across` times in width and `down` times in height."""
        import cv2

        height, width = self.pixels.shape[:2]
        across = min(across, width.bit_length() - 2)
        down = min(down, height.bit_length() - 2)
        if across <= 0 and down <= 0:
            return self.pixels
        key = (max(across, 0), max(down, 0))
        if key not in self._levels:
            size = (max(1, width >> key[0]), max(1, height >> key[1]))
            small = cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA)
            self._levels[key] = np.asarray(small, np.uint8)
        return self._levels[key]


class Canvas:
    """The enlarged picture that is being painted, far things first.

    Parameters
    ----------
    view : View
    look : Look
    haze : uint8, shape of the enlarged picture
        Full of the haze's colour; shared between frames, never written to.
    """

    def __init__(self, view: View, look: Look, haze: ImageArray) -> None:
        height, width = view.camera.canvas
        self.view, self.look = view, look
        self.pixels: ImageArray = np.empty((height, width, 3), np.uint8)
        self._haze = haze
        self.bare_ground: ImageArray | None = None
        """The picture before anything stood on the ground; kept where the road is wet."""
        self.glows: list[tuple[float, float, float, FloatArray]] = []

    def haze_at(self, depth: float) -> float:
        """Return how much of a thing's colour haze has replaced at a depth in metres."""
        return 1.0 - math.exp(-max(depth, 0.0) / self.look.sight_m)

    def panel(
        self, texture: Texture, corner: Points, across: Points, down: Points,
        light: FloatArray | None = None,
    ) -> None:  # fmt: skip
        """Draw a texture on a parallelogram in camera space.

        Parameters
        ----------
        texture : Texture
        corner, across, down : float64 (3,)
            Top left corner and the two edges from it, camera space, metres.
        light : float32 (3,), optional
            Multiplies the colours.
        """
        plane = _Plane(corner.tolist(), across.tolist(), down.tolist())
        start, end = plane.visible_part()
        if end - start > 1e-3:
            self._panel_part(texture, plane, (start, end), light)

    def _panel_part(
        self, texture: Texture, plane: "_Plane", part: tuple[float, float], light: FloatArray | None
    ) -> None:
        """Draw the part of a panel between two fractions of its width, halving it if long."""
        start, end = part
        ahead, slope = plane.corner[2], plane.across[2]
        near, far = sorted((ahead + start * slope, ahead + end * slope))
        if far > 2.2 * near > 0 and near < 40:
            middle = (math.sqrt(near * far) - ahead) / slope
            halves = [(start, middle), (middle, end)]
            for half in halves if slope < 0 else halves[::-1]:
                self._panel_part(texture, plane, half, light)
            return
        outline = _cut(texture.outline, start, end)
        if len(outline) < 3:
            return
        corners = plane.project(self.view, outline)
        box = self._box(corners)
        if box is None:
            return
        ratios = _texels_per_pixel(texture, corners, outline)
        across, down = (math.floor(math.log2(max(ratio, 1.0)) + 0.35) for ratio in ratios)
        patch = self._warp(texture.level(across, down), plane, box, halved=max(ratios) < 0.8)
        self._blend(patch, corners, box, self.haze_at((near + far) / 2), light)

    def _box(self, corners: list[Point]) -> tuple[int, int, int, int] | None:
        """Return the pixels (left, top, right, bottom) around the corners, or None if outside."""
        height, width = self.pixels.shape[:2]
        columns, rows = [c for c, _ in corners], [r for _, r in corners]
        left, top = max(0, math.floor(min(columns))), max(0, math.floor(min(rows)))
        right = min(width, math.ceil(max(columns)) + 1)
        bottom = min(height, math.ceil(max(rows)) + 1)
        return (left, top, right, bottom) if right > left and bottom > top else None

    def _warp(
        self, pixels: ImageArray, plane: "_Plane", box: tuple[int, int, int, int], *, halved: bool
    ) -> ImageArray:
        """Return the texture in perspective, cut to the box.

        With `halved` it is worked out at half the size and enlarged: as good, and cheaper, where
        the texture is coarser than the picture.
        """
        import cv2

        width, height = box[2] - box[0], box[3] - box[1]
        matrix = plane.texel_of_pixel(self.view, pixels.shape, (box[0], box[1]))
        size = (width, height)
        if halved:
            size = ((width + 1) // 2, (height + 1) // 2)
            matrix = matrix @ np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
        border = cv2.BORDER_CONSTANT if pixels.shape[2] == 4 else cv2.BORDER_REPLICATE
        patch = cv2.warpPerspective(pixels, matrix, size, borderMode=border,
                                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)  # fmt: skip
        if halved:
            whole = (2 * size[0], 2 * size[1])
            patch = cv2.resize(patch, whole, interpolation=cv2.INTER_LINEAR)[:height, :width]
        return np.asarray(patch)

    def _blend(
        self, patch: ImageArray, corners: list[Point], box: tuple[int, int, int, int], haze: float,
        light: FloatArray | None,
    ) -> None:  # fmt: skip
        """Put a patch with its haze and light on the picture."""
        import cv2

        left, top, right, bottom = box
        target = self.pixels[top:bottom, left:right]
        hazes = self._haze[: bottom - top, : right - left]
        has_alpha = patch.shape[2] == 4
        alpha = None
        if has_alpha:
            alpha = cv2.cvtColor(cv2.extractChannel(patch, 3), cv2.COLOR_GRAY2RGB)
        colours = cv2.cvtColor(patch, cv2.COLOR_RGBA2RGB) if has_alpha else patch
        if light is not None:
            colours = cv2.multiply(colours, np.array([*light.tolist(), 0.0]))
        if haze > 0.03:
            cover = hazes if alpha is None else cv2.multiply(hazes, alpha, scale=1 / 255)
            colours = cv2.addWeighted(colours, 1.0 - haze, cover, haze, 0.0)
        if alpha is None:
            mask = np.zeros(colours.shape[:2], np.uint8)
            cv2.fillConvexPoly(mask, _fixed(np.array(corners) - (left, top)), 255, shift=SHIFT)
            cv2.copyTo(colours, mask, target)
        else:
            kept = cv2.multiply(target, cv2.bitwise_not(alpha), scale=1 / 255)
            cv2.add(kept, colours, dst=target)

    def faces(self, corners: Points, counts: list[int], colours: FloatArray) -> None:
        """Fill the convex faces of one solid in the given order.

        Parameters
        ----------
        corners : float64 (n, 3)
            Of all faces, one after the other, camera space.
        counts : list of int
            How many corners each face has.
        colours : float32 (faces, 3)
        """
        import cv2

        nearest = float(corners[:, 2].min())
        if nearest <= NEAR_M:
            self._clipped_faces(corners, counts, colours)
            return
        pixels = self.view.project(corners)
        width = self.pixels.shape[1]
        if pixels[:, 0].max() < 0 or pixels[:, 0].min() > width:
            return
        haze = np.float32(self.haze_at(nearest))
        shown = (np.clip(colours, 0, 255) * (1 - haze) + self.look.haze * haze).tolist()
        points = _fixed(np.clip(pixels, -4 * width, 4 * width) - 0.5)
        start = 0
        for count, colour in zip(counts, shown, strict=True):
            cv2.fillConvexPoly(self.pixels, points[start : start + count], colour, shift=SHIFT)
            start += count

    def _clipped_faces(self, corners: Points, counts: list[int], colours: FloatArray) -> None:
        """Fill faces of a solid that reaches behind the camera."""
        ends = np.cumsum(counts)
        for end, count, colour in zip(ends, counts, colours, strict=True):
            self.polygon(corners[end - count : end], np.clip(colour, 0, 255))

    def polygon(self, corners: Points, colour: FloatArray, *, haze: float | None = None) -> None:
        """Fill a flat polygon in camera space (n, 3) with one colour."""
        import cv2

        corners = _clip_near(corners)
        if len(corners) < 3:
            return
        if haze is None:
            haze = self.haze_at(float(corners[:, 2].min()))
        shown = colour * np.float32(1.0 - haze) + self.look.haze * np.float32(haze)
        limit = 4.0 * self.pixels.shape[1]
        points = _fixed(np.clip(self.view.project(corners), -limit, limit) - 0.5)
        cv2.fillPoly(self.pixels, [points], shown.tolist(), shift=SHIFT)

    def patches(self, corners: Points, colours: FloatArray) -> None:
        """Fill many four-cornered patches (n, 4, 3), without haze, where all of one is in view."""
        import cv2

        seen = corners[:, :, 2].min(axis=1) > NEAR_M
        if not seen.any():
            return
        pixels = self.view.project(corners[seen].reshape(-1, 3))
        limit = 4.0 * self.pixels.shape[1]
        points = _fixed(np.clip(pixels, -limit, limit) - 0.5).reshape(-1, 4, 2)
        for patch, colour in zip(points, colours[seen].tolist(), strict=True):
            cv2.fillConvexPoly(self.pixels, patch, colour, shift=SHIFT)

    def strip(self, first: Points, second: Points, colour: FloatArray) -> None:
        """Fill the band on the ground between two lines in camera space (n, 3), without haze."""
        seen = (first[:, 2] > NEAR_M) & (second[:, 2] > NEAR_M)
        if seen.sum() >= 2:
            around = np.concatenate([first[seen], second[seen][::-1]])
            self.polygon(around, colour, haze=0.0)

    def glow(self, place: Points, radius_m: float, colour: FloatArray) -> None:
        """Remember a light at a camera-space point (3,), to be added when all is painted."""
        if place[2] > NEAR_M:
            column, row = self.view.project(place[None])[0]
            radius = self.view.camera.focal * radius_m / place[2]
            haze = self.haze_at(float(place[2]))
            self.glows.append((float(column), float(row), radius, colour * np.float32(1 - haze)))


@dataclass(frozen=True)
class _Plane:
    """A panel's parallelogram, in plain numbers: much faster than arrays of three."""

    corner: list[float]
    across: list[float]
    down: list[float]

    def visible_part(self) -> tuple[float, float]:
        """Return the fractions of the width between which all of it lies before the camera."""
        depth, slope = self.corner[2] + min(0.0, self.down[2]), self.across[2]
        if abs(slope) < 1e-9:
            return (0.0, 1.0) if depth > NEAR_M else (0.0, 0.0)
        edge = (NEAR_M - depth) / slope
        return (max(0.0, edge), 1.0) if slope > 0 else (0.0, min(1.0, edge))

    def project(self, view: View, outline: list[Point]) -> list[Point]:
        """Return the pixels of points given in parts of width and height."""
        (x, y, z), (ax, ay, az), (dx, dy, dz) = self.corner, self.across, self.down
        focal, (column, row) = view.camera.focal, view.centre
        pixels = []
        for u, v in outline:
            scale = focal / (z + u * az + v * dz)
            pixels.append((column + scale * (x + u * ax + v * dx),
                           row + scale * (y + u * ay + v * dy)))  # fmt: skip
        return pixels

    def texel_of_pixel(self, view: View, shape: tuple[int, ...], origin: tuple[int, int]) -> Points:
        """Return the 3 x 3 matrix from pixels, counted from `origin`, to texture pixels."""
        focal, (column, row) = view.camera.focal, view.centre
        column, row = column - origin[0] - 0.5, row - origin[1] - 0.5
        height, width = shape[:2]
        a = [value / width for value in self.across]
        d = [value / height for value in self.down]
        c = [self.corner[i] + 0.5 * (a[i] + d[i]) for i in range(3)]
        forward = [[focal * edge[k] + (column, row)[k] * edge[2] for edge in (a, d, c)]
                   for k in (0, 1)]  # fmt: skip
        return _inverse([*forward, [a[2], d[2], c[2]]])


def _inverse(m: list[list[float]]) -> Points:
    """Return the inverse of a 3 x 3 matrix up to a factor, which a homography does not feel."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return np.array([[e * i - f * h, c * h - b * i, b * f - c * e],
                     [f * g - d * i, a * i - c * g, c * d - a * f],
                     [d * h - e * g, b * g - a * h, a * e - b * d]])  # fmt: skip


def _texels_per_pixel(
    texture: Texture, corners: list[Point], outline: list[Point]
) -> tuple[float, float]:
    """Return how many texture pixels fall on one of the picture, across and down."""
    height, width = texture.pixels.shape[:2]
    across = width * _extent(outline, 0) / max(_extent(corners, 0), 0.5)
    down = height * _extent(outline, 1) / max(_extent(corners, 1), 0.5)
    return across, down


def _extent(points: list[Point], axis: int) -> float:
    values = [point[axis] for point in points]
    return max(values) - min(values)


def _cut(outline: list[Point], start: float, end: float) -> list[Point]:
    """Return the part of a convex outline between two vertical lines."""
    if start <= 0.0 and end >= 1.0:
        return outline
    if outline is FULL:
        return [(start, 0.0), (end, 0.0), (end, 1.0), (start, 1.0)]
    points = np.array(outline)
    points = _half_plane(points, points[:, 0] - start)
    points = _half_plane(points, end - points[:, 0])
    return [(float(u), float(v)) for u, v in points]


def _half_plane(points: Points, inside: NDArray[np.float64]) -> Points:
    """Return the part of a convex polygon where `inside` >= 0, by Sutherland and Hodgman."""
    kept: list[Array] = []
    for i in range(len(points)):
        j = i - 1
        if (inside[i] >= 0) != (inside[j] >= 0):
            t = inside[j] / (inside[j] - inside[i])
            kept.append(points[j] + t * (points[i] - points[j]))
        if inside[i] >= 0:
            kept.append(points[i])
    return np.array(kept).reshape(-1, points.shape[1])


def _clip_near(points: Points) -> Points:
    """Return the part of a polygon (n, 3) that lies before the camera."""
    if points[:, 2].min() > NEAR_M:
        return points
    return _half_plane(points, points[:, 2] - NEAR_M)


def _fixed(points: Points) -> NDArray[np.int32]:
    """Return points in fixed point, as OpenCV takes them."""
    return np.rint(points * (1 << SHIFT)).astype(np.int32)
