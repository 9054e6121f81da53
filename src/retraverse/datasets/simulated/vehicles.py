"""Cars, vans and people as small solids, drawn face by face.

Local axes of a solid: x to its right, y to its front, z up; origin on the ground under it.
The faces that a camera can see depend on its side and end alone, so each body keeps four
ready lists of faces, and a far one in fewer faces.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.camera import NEAR_M, Points
from retraverse.datasets.simulated.canvas import Canvas
from retraverse.types import FloatArray

__all__ = ["Body", "Place", "draw_person", "draw_vehicle", "vehicle_body"]

PAINTS = ((186, 188, 192), (226, 226, 226), (36, 38, 42), (92, 96, 102), (138, 30, 32),
          (34, 60, 112), (58, 84, 74), (160, 150, 130), (152, 104, 62), (70, 110, 150),
          (206, 208, 210), (60, 62, 68))  # fmt: skip
GLASS = (58, 68, 78)
SNOW = np.array([236, 240, 246], np.float32)
FAR_M = 45.0
"""Beyond this a vehicle is drawn without wheels' rims and lamps."""

Corner = tuple[float, float, float]
Tone = tuple[float, ...]


@dataclass(frozen=True)
class Body:
    """Shape and paint of a vehicle, metres."""

    length: float
    width: float
    belt: float
    """Height of the body under the windows."""
    roof: float
    cabin: tuple[float, float, float, float]
    """Where the cabin begins and ends along y: rear foot, rear top, front top, front foot."""
    paint: tuple[int, int, int]
    is_van: bool = False

    def painted(self, shade: float) -> Tone:
        """Return the paint's colour under a shade."""
        return tuple(shade * value for value in self.paint)


@lru_cache(maxsize=512)
def vehicle_body(seed: int) -> Body:
    """Return a hatchback, saloon, estate or van."""
    rng = np.random.default_rng([seed, 40])
    paint = PAINTS[int(rng.integers(len(PAINTS)))]
    kind, size = rng.random(), float(rng.uniform(0.94, 1.06))
    if kind < 0.42:
        return Body(3.9 * size, 1.72, 0.86, 1.47, (-1.9, -1.45, 0.45, 1.1), paint)
    if kind < 0.72:
        return Body(4.5 * size, 1.78, 0.84, 1.43, (-1.75, -0.95, 0.5, 1.25), paint)
    if kind < 0.86:
        return Body(4.6 * size, 1.82, 0.95, 1.66, (-2.25, -2.0, 0.55, 1.2), paint)
    return Body(5.3 * size, 1.95, 1.15, 2.35, (-2.62, -2.6, 1.3, 2.0), paint, is_van=True)


@dataclass(frozen=True)
class Place:
    """Where a solid stands in camera space, and the light that falls on it."""

    right: float
    down: float
    forward: float
    turn: float
    """Its heading relative to the camera's, radians, clockwise seen from above."""
    light: FloatArray
    is_moving: bool = False

    def to_camera(self, local: Points) -> Points:
        """Return local points (n, 3) in camera space."""
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        points = np.empty(local.shape)
        points[:, 0] = self.right + local[:, 0] * cosine + local[:, 1] * sine
        points[:, 1] = self.down - local[:, 2]
        points[:, 2] = self.forward - local[:, 0] * sine + local[:, 1] * cosine
        return points

    def camera_local(self) -> tuple[float, float]:
        """Return the camera's x and y in the solid's own axes."""
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        x = -self.right * cosine + self.forward * sine
        return x, -self.right * sine - self.forward * cosine


@dataclass
class _Faces:
    """Faces of a solid in the order they are drawn."""

    corners: list[Corner]
    counts: list[int]
    colours: list[Tone]

    def add(self, corners: list[Corner], colour: Tone) -> None:
        self.corners += corners
        self.counts.append(len(corners))
        self.colours.append(colour)

    def arrays(self) -> tuple[Points, list[int], FloatArray]:
        return np.array(self.corners), self.counts, np.array(self.colours, np.float32)


def draw_vehicle(canvas: Canvas, body: Body, place: Place) -> None:
    """Draw a vehicle, its shadow, and while it moves at night its lamps.

    Parameters
    ----------
    canvas : Canvas
    body : Body
    place : Place
    """
    if place.forward < -body.length:
        return
    x, y = place.camera_local()
    side = 0 if abs(x) < 0.4 * body.width else int(math.copysign(1, x))
    end = 0 if abs(y) < body.length / 2 else int(math.copysign(1, y))
    corners, counts, colours = _vehicle_faces(body, side, end, place.forward > FAR_M)
    if canvas.look.snow > 0 and not place.is_moving:
        colours = colours.copy()
        colours[-1] += np.float32(0.9 * canvas.look.snow) * (SNOW - colours[-1])
    canvas.faces(place.to_camera(corners), counts, colours * place.light)
    if place.is_moving and canvas.look.darkness > 0.2:
        _draw_lamps(canvas, body, place, faces_rear=y < 0)


@lru_cache(maxsize=2048)
def _vehicle_faces(
    body: Body, side: int, end: int, is_far: bool
) -> tuple[Points, list[int], FloatArray]:
    """Return what is seen from a side (-1, 0, 1) and an end (-1 rear, 0 neither, 1 front)."""
    faces = _Faces([], [], [])
    half, reach = body.width / 2, body.length / 2
    faces.add([(-half, -reach, 0.02), (half, -reach, 0.02), (half, reach, 0.02),
               (-half, reach, 0.02)], (34, 34, 38))  # fmt: skip
    if side:
        _add_side(faces, body, side * half, is_far)
    _add_deck(faces, body, end <= 0)
    if end:
        _add_end(faces, body, end < 0, is_far)
    _add_cabin(faces, body, side or 1, end <= 0)
    return faces.arrays()


def _add_side(faces: _Faces, body: Body, x: float, is_far: bool) -> None:
    """Add the long side with its sills and wheels."""
    end, belt = body.length / 2, body.belt
    faces.add([(x, -end, 0.35), (x, -end + 0.1, 0.22), (x, end - 0.1, 0.22), (x, end, 0.35),
               (x, end, 0.62), (x, end - 0.15, belt - 0.14), (x, body.cabin[3], belt),
               (x, -end + 0.05, belt)], body.painted(0.82))  # fmt: skip
    faces.add([(x, -end + 0.1, 0.22), (x, end - 0.1, 0.22), (x, end - 0.1, 0.36),
               (x, -end + 0.1, 0.36)], body.painted(0.42))  # fmt: skip
    angles = np.linspace(0, 2 * np.pi, 6 if is_far else 14, endpoint=False).tolist()
    rings = ((0.34, 22.0),) if is_far else ((0.37, 16.0), (0.31, 34.0), (0.19, 128.0))
    for y in (-end + 0.82, end - 0.8):
        for radius, tone in rings:
            rim = [(x, y + radius * math.sin(a), 0.31 + radius * math.cos(a)) for a in angles]
            faces.add(rim, (tone, tone, tone))
    if not is_far:
        for y in (body.cabin[0] + 0.9, body.cabin[2] + 0.25):
            faces.add([(x, y, 0.4), (x, y + 0.02, 0.4), (x, y + 0.02, belt), (x, y, belt)],
                      body.painted(0.55))  # fmt: skip


def _add_deck(faces: _Faces, body: Body, is_rear: bool) -> None:
    """Add bonnet or boot lid: the flat part between an end and the cabin."""
    half, end, belt = body.width / 2, body.length / 2, body.belt
    edge, foot, drop = (-end, body.cabin[0], 0.04) if is_rear else (end, body.cabin[3], 0.14)
    faces.add([(-half, edge, belt - drop), (half, edge, belt - drop), (half, foot, belt),
               (-half, foot, belt)], body.painted(1.08))  # fmt: skip


def _add_end(faces: _Faces, body: Body, is_rear: bool, is_far: bool) -> None:
    """Add the rear or the front: bumper, plate, lamps."""
    half, belt = body.width / 2, body.belt
    y = -body.length / 2 if is_rear else body.length / 2
    top = body.roof - 0.15 if body.is_van and is_rear else belt - (0.04 if is_rear else 0.14)

    def box(x0: float, z0: float, x1: float, z1: float, colour: Tone) -> None:
        faces.add([(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)], colour)

    box(-half, 0.26, half, top, body.painted(0.88))
    box(-half, 0.24, half, 0.46, body.painted(0.5))
    if not is_far:
        if not is_rear:
            box(-0.5, 0.46, 0.5, belt - 0.28, (30, 30, 32))
        low = 0.52 if is_rear else 0.32
        box(-0.26, low, 0.26, low + 0.12, (222, 218, 190))
    lamp = (168.0, 26.0, 26.0) if is_rear else (232.0, 232.0, 220.0)
    for sign in (-1, 1):
        x0, x1 = sorted((sign * half * 0.97, sign * half * 0.64))
        box(x0, belt - 0.32, x1, belt - 0.16, lamp)


def _add_cabin(faces: _Faces, body: Body, side: int, is_rear: bool) -> None:
    """Add the windows and the roof."""
    rear, rear_top, front_top, front = body.cabin
    low, high = body.width / 2 - 0.02, body.width / 2 - (0.06 if body.is_van else 0.2)
    belt, roof = body.belt, body.roof
    faces.add([(side * low, rear, belt), (side * low, front, belt), (side * high, front_top, roof),
               (side * high, rear_top, roof)], body.painted(0.78))  # fmt: skip
    begin = front_top - 1.0 if body.is_van else rear + 0.22
    upper = front_top - 0.9 if body.is_van else rear_top + 0.12
    faces.add([(side * low, begin, belt + 0.04), (side * low, front - 0.16, belt + 0.04),
               (side * high, front_top - 0.04, roof - 0.1), (side * high, upper, roof - 0.1)],
              GLASS)  # fmt: skip
    if not body.is_van:
        post = (begin + front) / 2 - 0.1
        faces.add([(side * low, post, belt), (side * low, post + 0.1, belt),
                   (side * high, post + 0.02, roof - 0.1), (side * high, post - 0.06, roof - 0.1)],
                  body.painted(0.5))  # fmt: skip
    foot, top = (rear, rear_top) if is_rear else (front, front_top)
    faces.add([(-low, foot, belt), (low, foot, belt), (high, top, roof), (-high, top, roof)],
              body.painted(0.8))  # fmt: skip
    if not (body.is_van and is_rear):
        step = 0.1 * (top - foot)
        middle = (belt + roof) / 2 + 0.05
        part = (middle - belt) / (roof - belt)
        wide, along = low - 0.1 + (high - low) * part, foot + (top - foot) * part
        lower = [(-low + 0.1, foot + step, belt + 0.05), (low - 0.1, foot + step, belt + 0.05)]
        faces.add([*lower, (wide, along, middle), (-wide, along, middle)], (58, 66, 74))
        faces.add([(-wide, along, middle), (wide, along, middle),
                   (high - 0.1, top - step, roof - 0.08), (-high + 0.1, top - step, roof - 0.08)],
                  (104, 116, 126))  # fmt: skip
    faces.add([(-high, rear_top, roof), (high, rear_top, roof), (high, front_top, roof),
               (-high, front_top, roof)], body.painted(1.1))  # fmt: skip


def _draw_lamps(canvas: Canvas, body: Body, place: Place, *, faces_rear: bool) -> None:
    """Add the glow of head or tail lamps."""
    tint = [255.0, 40.0, 30.0] if faces_rear else [255.0, 244.0, 214.0]
    colour = np.array(tint, np.float32) * np.float32(canvas.look.darkness)
    y = -body.length / 2 if faces_rear else body.length / 2
    lamps = np.array([[sign * body.width * 0.4, y, body.belt - 0.25] for sign in (-1, 1)])
    for point in place.to_camera(lamps):
        canvas.glow(point, 0.13, colour)
        canvas.glow(point, 0.5 if faces_rear else 1.1, colour * np.float32(0.35))


def draw_person(canvas: Canvas, seed: int, place: Place, phase: float) -> None:
    """Draw a walking person, upright and facing the camera; `phase` moves the legs."""
    if place.forward < NEAR_M + 0.3:
        return
    rng = np.random.default_rng([seed, 41])
    coat = (float(rng.uniform(36, 150)) + rng.normal(0, 20, 3)).tolist()
    trousers = (float(rng.uniform(30, 90)) + rng.normal(0, 8, 3)).tolist()
    tone, tall = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.92, 1.06))
    skin = (204 * tone, 164 * tone, 138 * tone)
    sleeve = tuple(0.8 * value for value in coat)
    step, faces = 0.22 * math.sin(phase), _Faces([], [], [])

    def part(outline: list[tuple[float, float]], colour: Tone) -> None:
        faces.add([(x, 0.0, z * tall) for x, z in outline], colour)

    for foot in (-step, step):
        part([(-0.11, 0.9), (0.11, 0.9), (foot + 0.08, 0.0), (foot - 0.08, 0.0)], trousers)
    part([(-0.2, 1.46), (0.2, 1.46), (0.24, 0.8), (-0.24, 0.8)], coat)
    part([(-0.24, 1.42), (-0.17, 1.42), (-0.22 - step, 0.85), (-0.3 - step, 0.88)], sleeve)
    part([(0.24, 1.42), (0.17, 1.42), (0.22 + step, 0.85), (0.3 + step, 0.88)], sleeve)
    for radius, height, first, last, colour in (
        (0.13, 1.6, -math.pi, math.pi, skin),
        (0.125, 1.63, -1.9, 1.9, tuple(0.3 * value for value in skin)),
    ):
        turns = np.linspace(first, last, 10).tolist()
        part([(0.8 * radius * math.sin(a), height + radius * math.cos(a)) for a in turns], colour)
    corners, counts, colours = faces.arrays()
    upright = Place(place.right, place.down, place.forward, 0.0, place.light)
    canvas.faces(upright.to_camera(corners), counts, colours * place.light)
