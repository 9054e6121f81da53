"""Draws houses: which surfaces a camera sees of one, and where they lie."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from retraverse.datasets.simulated.camera import NEAR_M, Points
from retraverse.datasets.simulated.canvas import Canvas, Texture
from retraverse.datasets.simulated.conditions import Look
from retraverse.datasets.simulated.lighting import wall_light
from retraverse.datasets.simulated.scene import Seen
from retraverse.datasets.simulated.street import Street
from retraverse.datasets.simulated.things import Building
from retraverse.datasets.simulated.walls import paint_end_wall, paint_front, paint_roof

__all__ = ["HousePainter"]

UP = np.array([0.0, -1.0, 0.0])
"""Up in camera space."""


CHIMNEY_M = 100.0
"""Chimneys farther away are left out."""


@dataclass(frozen=True)
class _Corners:
    """A house's ground plan in camera space."""

    start: Points
    """Front corner at the near end, on the ground."""
    along: Points
    """From there to the far end of the front."""
    back: Points
    """From there to the rear corner."""


class HousePainter:
    """Draws the houses of one street under one look; keeps the textures of recent ones."""

    def __init__(self, street: Street, look: Look) -> None:
        self.street, self.look = street, look
        self._front = lru_cache(maxsize=160)(self._paint_front)
        self._end = lru_cache(maxsize=160)(self._paint_end)
        self._roof = lru_cache(maxsize=160)(self._paint_roof)

    def _paint_front(self, building: Building) -> Texture:
        light = wall_light(self.street, self.look, building, "front")
        return paint_front(building, self.look, light)

    def _paint_end(self, building: Building) -> Texture:
        light = wall_light(self.street, self.look, building, "end")
        return paint_end_wall(building, self.look, light)

    def _paint_roof(self, building: Building, slope_m: float) -> Texture:
        light = wall_light(self.street, self.look, building, "roof")
        return paint_roof(building, self.look, light, slope_m)

    def draw(self, canvas: Canvas, building: Building, seen: Seen) -> None:
        """Draw what can be seen of a house."""
        start, end, rear = seen.anchors
        plan = _Corners(start, end - start, rear - start)
        if max(plan.start[2], (plan.start + plan.along)[2]) < NEAR_M:
            return
        eaves = UP * building.eaves_m
        if plan.start @ plan.along > 0 and not seen.hides_end:
            top = UP * (building.eaves_m + (building.roof_m if building.roof == "ridge" else 0.0))
            canvas.panel(self._end(building), plan.start + top, plan.back, -top)
        if building.roof != "flat":
            self._draw_roof(canvas, building, plan, eaves)
        if plan.start @ plan.back > 0:
            top = UP * (building.eaves_m + (building.roof_m if building.roof == "gable" else 0.0))
            canvas.panel(self._front(building), plan.start + top, plan.along, -top)

    def _draw_roof(self, canvas: Canvas, building: Building, plan: _Corners, eaves: Points) -> None:
        """Draw the slope towards the street, or for a gable the slope towards the camera."""
        rise = UP * building.roof_m
        if building.roof == "gable":
            run, across = plan.along * 0.5, plan.back
        else:
            inset = 0.5 if building.roof == "ridge" else 1.4 / building.depth_m
            run, across = plan.back * inset, plan.along
        corner = plan.start + eaves + run + rise
        down = -(run + rise)
        if building.roof == "mansard":
            self._draw_mansard_end(canvas, building, plan, eaves + rise)
        if _faces_camera(corner, across, down):
            slope_m = round(float(np.linalg.norm(down)), 2)
            overhang = down * 1.06
            canvas.panel(self._roof(building, slope_m), corner, across, overhang)
        if building.roof == "ridge" and building.storeys <= 3 and corner[2] < CHIMNEY_M:
            self._draw_chimneys(canvas, building, corner, across)

    def _draw_mansard_end(
        self, canvas: Canvas, building: Building, plan: _Corners, top: Points
    ) -> None:
        inset = plan.back * (1.4 / building.depth_m)
        eaves = plan.start + UP * building.eaves_m
        corners = np.stack([eaves, plan.start + inset + top, plan.start + plan.back - inset + top,
                            eaves + plan.back])  # fmt: skip
        light = self.look.ambient
        canvas.polygon(corners, np.array(building.roof_colour, np.float32) * light)

    def _draw_chimneys(
        self, canvas: Canvas, building: Building, ridge: Points, across: Points
    ) -> None:
        """Draw one or two chimneys on the ridge, with snow caps."""
        width = 0.7 / float(np.linalg.norm(across))
        light = self.look.ambient + self.look.sun * np.float32(0.3)
        brick = np.array([128, 82, 68], np.float32) * light
        cap = np.array([232, 236, 242] if self.look.snow > 0.4 else [92, 84, 80], np.float32)
        colours = np.stack([brick, brick * np.float32(0.75), cap * light])
        for k in range(1 + building.seed % 2):
            at = ridge + across * (0.12 + 0.7 * (building.seed // 7 % 5 / 5 + 0.41 * k) % 0.86)
            side, tall = across * width, UP * (1.3 + building.seed % 3 * 0.25)
            foot, top = at - UP * 0.4, at - UP * 0.4 + tall
            out = np.array([side[2], 0.0, -side[0]])
            out *= 0.8 * np.sign(at @ out)
            corners = [_quad(foot, side, tall), _quad(foot, out, tall), _quad(top, side, UP * 0.14)]
            canvas.faces(np.concatenate(corners), [4, 4, 4], colours)


def _quad(corner: Points, across: Points, up: Points) -> Points:
    return np.array([corner, corner + across, corner + across + up, corner + up])


def _faces_camera(corner: Points, across: Points, down: Points) -> bool:
    """Return whether the upper side of a slope is seen from the camera."""
    (ax, ay, az), (dx, dy, dz) = across.tolist(), down.tolist()
    upwards = az * dx - ax * dz
    normal = np.array([ay * dz - az * dy, upwards, ax * dy - ay * dx])
    return bool((normal @ corner) * upwards > 0)
