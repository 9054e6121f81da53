"""Paints one frame: sky, ground, then everything along the street from far to near.

`Painter` holds what all frames of a drive share: the street, the look, and textures of what
was seen lately. A frame depends on the view and the frame's seed alone.
"""

import math
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.camera import NEAR_M, Camera, Points, View
from retraverse.datasets.simulated.canvas import Canvas, Texture
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.finish import finish
from retraverse.datasets.simulated.ground import GroundPainter
from retraverse.datasets.simulated.houses import HousePainter
from retraverse.datasets.simulated.lighting import light_on_thing
from retraverse.datasets.simulated.plants import SPRITE_ASPECT, paint_barrier, paint_tree
from retraverse.datasets.simulated.scene import Seen, make_scene
from retraverse.datasets.simulated.sky import SkyWindow, paint_panorama
from retraverse.datasets.simulated.street import VIEW_M, Street
from retraverse.datasets.simulated.things import (
    Barrier,
    Building,
    Lamp,
    ParkedCar,
    Sign,
    Tree,
    TreeKind,
)
from retraverse.datasets.simulated.traffic import Mover, Traffic
from retraverse.datasets.simulated.vehicles import Place, draw_person, draw_vehicle, vehicle_body
from retraverse.types import FloatArray, ImageArray

__all__ = ["Painter"]

POSTS = {"bin": (1.05, 0.55, (58, 74, 60)), "bollard": (0.95, 0.16, (60, 60, 64)),
         "cabinet": (1.25, 0.8, (120, 128, 118))}  # fmt: skip
"""Height, width and colour of small things on the pavement."""
PLATES = (((170, 34, 36), (226, 226, 222)), ((36, 70, 140), (52, 92, 170)))
"""Rim and face of traffic signs."""
SMALL_M, CARS_M = 75.0, 130.0
"""Signs and parked cars farther away are left out."""
TREE_FORMS = 14
"""How many different sprites of each kind of tree a street has."""


class Painter:
    """Paints frames of one street under one look.

    Parameters
    ----------
    street : Street
    look : Look
    camera : Camera
    """

    def __init__(self, street: Street, look: Look, camera: Camera) -> None:
        self.street, self.look, self.camera = street, look, camera
        self._sky_window = SkyWindow(camera)
        panorama = paint_panorama(street.seed, street.sun_azimuth, look)
        self._panorama = self._sky_window.padded(panorama)
        self._ground = GroundPainter(street, look)
        self._houses = HousePainter(street, look)
        self._tree = lru_cache(maxsize=64)(self._paint_tree)
        self._barrier = lru_cache(maxsize=128)(lambda barrier: paint_barrier(barrier, look))
        self._scene = make_scene(street)
        height, width = camera.canvas
        self._haze = np.empty((height, width, 3), np.uint8)
        self._haze[:] = np.clip(look.haze, 0, 255).astype(np.uint8)

    def _paint_tree(self, form: int, kind: TreeKind) -> Texture:
        return paint_tree(self.street.seed * TREE_FORMS + form, kind, self.look)

    def paint(self, view: View, traffic: Traffic, frame: int, noise_seed: int) -> ImageArray:
        """Return one frame.

        Parameters
        ----------
        view : View
            Where the camera is.
        traffic : Traffic
        frame : int
            Sets the time for the traffic.
        noise_seed : int
            Sensor noise and rain differ between drives by it.

        Returns
        -------
        picture : uint8 (height, width, 3), RGB
        """
        canvas = Canvas(view, self.look, self._haze)
        sky = self._sky_window.cut(self._panorama, view.heading, view.pitch)
        canvas.pixels[: len(sky)] = sky
        self._ground.paint(canvas)
        if self.look.wet > 0:
            canvas.bare_ground = canvas.pixels.copy()
        here = view.position_m
        seen: list[Seen | Mover] = list(self._scene.seen(view, here - 2, here + VIEW_M))
        seen += [mover for mover in traffic.movers(frame) if mover.key_m > here - 4]
        for item in sorted(seen, key=lambda item: -item.key_m):
            if isinstance(item, Mover):
                self._draw_mover(canvas, item)
            else:
                self._draw(canvas, item, traffic)
        return finish(canvas, np.random.default_rng([noise_seed, frame, 90]))

    def _draw(self, canvas: Canvas, seen: Seen, traffic: Traffic) -> None:
        """Draw one standing thing by its kind."""
        thing = seen.thing
        if isinstance(thing, Building):
            self._houses.draw(canvas, thing, seen)
        elif isinstance(thing, Tree):
            self._draw_tree(canvas, thing, seen.anchors[0])
        elif isinstance(thing, Barrier):
            self._draw_barrier(canvas, thing, seen.anchors)
        elif isinstance(thing, Lamp):
            self._draw_lamp(canvas, thing, seen.anchors)
        elif isinstance(thing, Sign):
            self._draw_sign(canvas, thing, seen.anchors[0])
        else:
            self._draw_parked(canvas, thing, seen, traffic)

    def _light(self, view: View, s: float, d: float) -> FloatArray:
        return light_on_thing(self.street, self.look, s, d, s - view.position_m)

    def _draw_parked(self, canvas: Canvas, car: ParkedCar, seen: Seen, traffic: Traffic) -> None:
        body = traffic.parked_body(car)
        if body is not None and seen.anchors[0, 2] < CARS_M:
            turn = canvas.view.heading - seen.heading + math.pi * (car.lateral_m < 0)
            light = self._light(canvas.view, car.key_m, car.lateral_m)
            right, down, forward = seen.anchors[0].tolist()
            place = Place(right, down, forward, turn, light)
            draw_vehicle(canvas, vehicle_body(body), place)

    def _draw_mover(self, canvas: Canvas, mover: Mover) -> None:
        view, s, d = canvas.view, mover.key_m, mover.lateral_m
        right, down, forward = view.to_camera(self.street.line.points(s, d))[0].tolist()
        turn = view.heading - float(self.street.line.heading_at(s)) + math.pi * mover.is_oncoming
        light = self._light(view, s, d)
        place = Place(right, down, forward, turn, light, is_moving=True)
        if mover.kind == "person":
            draw_person(canvas, mover.seed, place, mover.phase)
        else:
            draw_vehicle(canvas, vehicle_body(mover.seed), place)

    def _draw_tree(self, canvas: Canvas, tree: Tree, foot: Points) -> None:
        """Draw a tree's sprite upright, half of them mirrored."""
        if foot[2] < NEAR_M + 0.3:
            return
        wide = tree.height_m * SPRITE_ASPECT * (1.25 if tree.kind == "bush" else 1.0)
        across = np.array([wide if tree.seed % 2 else -wide, 0.0, 0.0])
        corner = foot - across / 2 - [0.0, tree.height_m, 0.0]
        light = self._light(canvas.view, tree.key_m, tree.lateral_m)
        texture = self._tree(tree.seed // 2 % TREE_FORMS, tree.kind)
        canvas.panel(texture, corner, across, np.array([0.0, tree.height_m, 0.0]), light)

    def _draw_barrier(self, canvas: Canvas, barrier: Barrier, anchors: Points) -> None:
        """Draw a barrier's face, and for a hedge its near end."""
        start, along = anchors[0], anchors[1] - anchors[0]
        if max(start[2], anchors[1, 2]) < NEAR_M:
            return
        up = np.array([0.0, -barrier.height_m, 0.0])
        middle = (barrier.start_m + barrier.end_m) / 2
        light = self._light(canvas.view, middle, barrier.lateral_m)
        canvas.panel(self._barrier(barrier), start + up, along, -up, light)
        if barrier.kind == "hedge" and start[2] > NEAR_M:
            thick = 0.6 * np.sign(barrier.lateral_m) / max(float(np.linalg.norm(along)), 1e-6)
            across = np.array([along[2], 0.0, -along[0]]) * thick
            canvas.panel(self._barrier(barrier), start + up, across, -up, light * np.float32(0.8))

    def _draw_lamp(self, canvas: Canvas, lamp: Lamp, anchors: Points) -> None:
        """Draw pole, arm and head, and at night its glow."""
        foot = anchors[0]
        if foot[2] < NEAR_M:
            return
        grey = np.array([82, 88, 90], np.float32)
        light = self._light(canvas.view, lamp.key_m, lamp.lateral_m)
        up, thick = np.array([0.0, -lamp.height_m, 0.0]), np.array([0.0, 0.09, 0.0])
        top, head, size = foot + up, anchors[1] + up, np.array([0.3, 0.0, 0.0])
        corners = [*_pole(foot, lamp.height_m, 0.16),
                   np.array([top - thick, head - thick * 2, head - thick, top + thick]),
                   np.array([head - size - thick, head + size - thick, head + size + thick,
                             head - size + thick])]  # fmt: skip
        colours = np.stack([grey, grey * np.float32(1.35), grey, grey]) * light
        colours[3] += np.float32(230 * self.look.lamps)
        canvas.faces(np.concatenate(corners), [4, 4, 4, 4], colours)
        if self.look.lamps > 0:
            warm = np.array([255, 214, 150], np.float32) * np.float32(self.look.lamps)
            canvas.glow(head, 0.3, warm)
            canvas.glow(head, 1.7, warm * np.float32(0.42))

    def _draw_sign(self, canvas: Canvas, sign: Sign, foot: Points) -> None:
        """Draw a traffic sign on its post, or a bin, bollard or cabinet."""
        if not NEAR_M < foot[2] < SMALL_M:
            return
        tall, wide, tone = POSTS.get(sign.kind, (2.4, 0.07, (120, 122, 124)))
        colour = np.array(tone, np.float32)
        corners, colours = _pole(foot, tall, wide), [colour, colour * np.float32(1.35)]
        if sign.kind not in POSTS:
            middle = foot - [0.0, 2.45, 0.0]
            for size, plate in zip((0.36, 0.27), PLATES[sign.seed % 2], strict=True):
                corners.append(_plate(sign.kind, size) + middle)
                colours.append(np.array(plate, np.float32))
        light = self._light(canvas.view, sign.key_m, sign.lateral_m)
        counts = [len(face) for face in corners]
        canvas.faces(np.concatenate(corners), counts, np.stack(colours) * light)


def _pole(foot: Points, height: float, width: float) -> list[Points]:
    """Return an upright post that tapers, and its lit edge: two faces of four corners."""
    side, up = np.array([width / 2, 0.0, 0.0]), np.array([0.0, -height, 0.0])
    post = np.array([foot - side, foot + side, foot + up + side * 0.7, foot + up - side * 0.7])
    edge = np.array([foot - side, foot - side * 0.3,
                     foot + up - side * 0.2, foot + up - side * 0.7])  # fmt: skip
    return [post, edge]


@lru_cache(maxsize=8)
def _plate(kind: str, size: float) -> Points:
    """Return the outline of a sign's plate around its middle, (n, 3)."""
    sides = {"round": 16, "triangle": 3, "square": 4}[kind]
    turn = np.arange(sides) * 2 * np.pi / sides + (np.pi / 4 if sides == 4 else 0.0)
    return np.stack([np.sin(turn) * size, -np.cos(turn) * size, np.zeros(sides)], axis=1)
