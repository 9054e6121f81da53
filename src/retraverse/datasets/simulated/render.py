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
from retraverse.datasets.simulated.sky import SkyWindow, paint_panorama
from retraverse.datasets.simulated.street import VIEW_M, Street
from retraverse.datasets.simulated.things import (
    Barrier,
    Building,
    Lamp,
    ParkedCar,
    Sign,
    Thing,
    Tree,
    TreeKind,
)
from retraverse.datasets.simulated.traffic import Mover, Traffic
from retraverse.datasets.simulated.vehicles import Place, draw_person, draw_vehicle, vehicle_body
from retraverse.types import FloatArray, ImageArray

__all__ = ["Painter"]

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
        self._panorama = paint_panorama(street.seed, street.sun_azimuth, look)
        self._ground = GroundPainter(street, look)
        self._houses = HousePainter(street, look)
        self._tree = lru_cache(maxsize=64)(self._paint_tree)
        self._barrier = lru_cache(maxsize=128)(lambda barrier: paint_barrier(barrier, look))
        self._body = lru_cache(maxsize=512)(vehicle_body)

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
        canvas = Canvas(view, self.look)
        sky = self._sky_window.cut(self._panorama, view.heading, view.pitch)
        canvas.pixels[: len(sky)] = sky
        self._ground.paint(canvas)
        things: list[Thing | Mover] = list(
            self.street.things_between(view.position_m - 2, view.position_m + VIEW_M)
        )
        things += [m for m in traffic.movers(frame) if m.key_m > view.position_m - 4]
        for thing in sorted(things, key=lambda thing: -thing.key_m):
            self._draw(canvas, thing, traffic)
        return finish(canvas, np.random.default_rng([noise_seed, frame, 90]))

    def _draw(self, canvas: Canvas, thing: Thing | Mover, traffic: Traffic) -> None:
        """Draw one thing by its kind."""
        if isinstance(thing, Building):
            self._houses.draw(canvas, thing)
        elif isinstance(thing, Tree):
            self._draw_tree(canvas, thing)
        elif isinstance(thing, Barrier):
            self._draw_barrier(canvas, thing)
        elif isinstance(thing, Lamp):
            self._draw_lamp(canvas, thing)
        elif isinstance(thing, ParkedCar):
            body = traffic.parked_body(thing)
            if body is not None:
                place = self._place(canvas.view, thing.key_m, thing.lateral_m, thing.lateral_m < 0)
                draw_vehicle(canvas, self._body(body), place)
        elif isinstance(thing, Sign):
            self._draw_sign(canvas, thing)
        else:
            self._draw_mover(canvas, thing)

    def _spot(self, view: View, s: float, d: float) -> Points:
        """Return the ground point (3,) of a place, in camera space."""
        return view.to_camera(self.street.line.points(s, d))[0]

    def _light(self, view: View, s: float, d: float) -> FloatArray:
        return light_on_thing(self.street, self.look, s, d, s - view.position_m)

    def _place(self, view: View, s: float, d: float, is_oncoming: bool) -> Place:
        """Return where a vehicle stands; oncoming ones face the camera."""
        right, down, forward = self._spot(view, s, d)
        turn = view.heading - float(self.street.line.heading_at(s)) + math.pi * is_oncoming
        return Place(right, down, forward, turn, self._light(view, s, d))

    def _draw_mover(self, canvas: Canvas, mover: Mover) -> None:
        place = self._place(canvas.view, mover.key_m, mover.lateral_m, mover.is_oncoming)
        if mover.kind == "person":
            draw_person(canvas, mover.seed, place, mover.phase)
        else:
            moving = Place(**{**place.__dict__, "is_moving": True})
            draw_vehicle(canvas, self._body(mover.seed), moving)

    def _draw_tree(self, canvas: Canvas, tree: Tree) -> None:
        """Draw a tree's sprite upright, mirrored for half of them, over its own shade."""
        foot = self._spot(canvas.view, tree.key_m, tree.lateral_m)
        if foot[2] < NEAR_M + 0.3:
            return
        wide = tree.height_m * SPRITE_ASPECT * (1.25 if tree.kind == "bush" else 1.0)
        across = np.array([wide if tree.seed % 2 else -wide, 0.0, 0.0])
        corner = foot - across / 2 - [0.0, tree.height_m, 0.0]
        light = self._light(canvas.view, tree.key_m, tree.lateral_m)
        texture = self._tree(tree.seed // 2 % TREE_FORMS, tree.kind)
        canvas.panel(texture, corner, across, np.array([0.0, tree.height_m, 0.0]), light)

    def _draw_barrier(self, canvas: Canvas, barrier: Barrier) -> None:
        s = np.array([barrier.start_m, barrier.end_m])
        points = canvas.view.to_camera(self.street.line.points(s, barrier.lateral_m))
        if points[:, 2].max() < NEAR_M:
            return
        up = np.array([0.0, -barrier.height_m, 0.0])
        middle = (barrier.start_m + barrier.end_m) / 2
        light = self._light(canvas.view, middle, barrier.lateral_m)
        along = points[1] - points[0]
        canvas.panel(self._barrier(barrier), points[0] + up, along, -up, light)
        if barrier.kind == "hedge" and points[0, 2] > NEAR_M:
            thick = 0.6 * np.sign(barrier.lateral_m) / max(float(np.linalg.norm(along)), 1e-6)
            across = np.array([along[2], 0.0, -along[0]]) * thick
            shade = light * np.float32(0.8)
            canvas.panel(self._barrier(barrier), points[0] + up, across, -up, shade)

    def _draw_pole(
        self, canvas: Canvas, foot: Points, height: float, width: float, colour: FloatArray
    ) -> None:
        side, up = np.array([width / 2, 0.0, 0.0]), np.array([0.0, -height, 0.0])
        canvas.polygon(np.stack([foot - side, foot + side, foot + up + side * 0.7,
                                 foot + up - side * 0.7]), colour)  # fmt: skip
        lit = np.stack([foot - side, foot - side * 0.3, foot + up - side * 0.3, foot + up - side * 0.7])
        canvas.polygon(lit, colour * np.float32(1.35))

    def _draw_lamp(self, canvas: Canvas, lamp: Lamp) -> None:
        """Draw pole, arm and head, and at night its glow."""
        foot = self._spot(canvas.view, lamp.key_m, lamp.lateral_m)
        if foot[2] < NEAR_M:
            return
        light = self._light(canvas.view, lamp.key_m, lamp.lateral_m)
        grey = np.array([82, 88, 90], np.float32) * light
        self._draw_pole(canvas, foot, lamp.height_m, 0.16, grey)
        inner = lamp.lateral_m - math.copysign(1.3, lamp.lateral_m)
        head = self._spot(canvas.view, lamp.key_m, inner) - [0.0, lamp.height_m, 0.0]
        top = foot - [0.0, lamp.height_m, 0.0]
        thick = np.array([0.0, 0.09, 0.0])
        canvas.polygon(np.stack([top - thick, head - thick * 2, head - thick, top + thick]), grey)
        size = np.array([0.3, 0.0, 0.0])
        body = np.stack([head - size - thick, head + size - thick, head + size + thick,
                         head - size + thick])  # fmt: skip
        canvas.polygon(body, np.clip(grey * 1.1 + 230 * self.look.lamps, 0, 255))
        if self.look.lamps > 0:
            warm = np.array([255, 214, 150], np.float32) * np.float32(self.look.lamps)
            canvas.glow(head, 0.3, warm)
            canvas.glow(head, 1.7, warm * np.float32(0.42))

    def _draw_sign(self, canvas: Canvas, sign: Sign) -> None:
        """Draw a traffic sign on its post, or a bin, bollard or cabinet."""
        foot = self._spot(canvas.view, sign.key_m, sign.lateral_m)
        if foot[2] < NEAR_M:
            return
        light = self._light(canvas.view, sign.key_m, sign.lateral_m)
        if sign.kind in ("bin", "bollard", "cabinet"):
            tall, wide, tone = {"bin": (1.05, 0.55, (58, 74, 60)), "bollard": (0.95, 0.16, (60, 60, 64)),
                                "cabinet": (1.25, 0.8, (120, 128, 118))}[sign.kind]  # fmt: skip
            self._draw_pole(canvas, foot, tall, wide, np.array(tone, np.float32) * light)
            return
        self._draw_pole(canvas, foot, 2.4, 0.07, np.array([120, 122, 124], np.float32) * light)
        rim, face = (((170, 34, 36), (226, 226, 222)), ((36, 70, 140), (52, 92, 170)))[sign.seed % 2]
        middle = foot - [0.0, 2.45, 0.0]
        for size, colour in ((0.36, rim), (0.27, face)):
            shape = _plate(sign.kind, size) + middle
            canvas.polygon(shape, np.array(colour, np.float32) * light)


def _plate(kind: str, size: float) -> Points:
    """Return the outline of a sign's plate around its middle, (n, 3)."""
    sides = {"round": 16, "triangle": 3, "square": 4}[kind]
    turn = np.arange(sides) * 2 * np.pi / sides + (np.pi / 4 if sides == 4 else 0.0)
    return np.stack([np.sin(turn) * size, -np.cos(turn) * size, np.zeros(sides)], axis=1)
