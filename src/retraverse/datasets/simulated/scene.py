"""The standing things of a street as arrays: where each is in the world, computed once.

Every thing has three anchor points on the ground; which they are depends on its kind: a
house's near, far and rear corner; the two ends of a barrier; a lamp's foot and head; for
anything else its foot.
"""

from dataclasses import dataclass

import numpy as np

from retraverse.datasets.simulated.camera import Points, View
from retraverse.datasets.simulated.path import Metres
from retraverse.datasets.simulated.street import Street
from retraverse.datasets.simulated.things import Barrier, Building, Lamp, Thing
from retraverse.types import BoolArray

__all__ = ["LAMP_ARM_M", "Scene", "Seen", "make_scene"]

LAMP_ARM_M = 1.3


@dataclass(frozen=True)
class Seen:
    """One thing as a camera has it."""

    thing: Thing
    anchors: Points
    """(3, 3), camera space."""
    heading: float
    """Of the street beside it, radians."""
    hides_end: bool
    """A house whose near end wall a neighbour hides."""

    @property
    def key_m(self) -> float:
        """Place by which it is painted."""
        return self.thing.key_m


@dataclass(frozen=True)
class Scene:
    """Things sorted by place, with their anchors in the world."""

    things: tuple[Thing, ...]
    keys: Metres
    anchors: Points
    """(n, 3, 3): things, anchors, x y z."""
    headings: Metres
    hides_end: BoolArray

    def seen(self, view: View, start_m: float, end_m: float) -> list[Seen]:
        """Return the things between two places, with their anchors in camera space."""
        low, high = (int(np.searchsorted(self.keys, s)) for s in (start_m, end_m))
        points = view.to_camera(self.anchors[low:high])
        return [
            Seen(self.things[i], points[i - low], float(self.headings[i]), bool(self.hides_end[i]))
            for i in range(low, high)
        ]


def make_scene(street: Street) -> Scene:
    """Return the scene of a street."""
    keys = np.array([thing.key_m for thing in street.things])
    places = np.array([_places(thing) for thing in street.things])
    anchors = street.line.points(places[:, :, 0], places[:, :, 1])
    hides = np.zeros(len(keys), bool)
    neighbours: dict[int, Building] = {}
    for i, thing in enumerate(street.things):
        if isinstance(thing, Building):
            anchors[i, 2] = _rear_corner(anchors[i], thing)
            if not thing.is_backdrop:
                hides[i] = _is_hidden_by(thing, neighbours.get(thing.side))
                neighbours[thing.side] = thing
    return Scene(street.things, keys, anchors, street.line.heading_at(keys), hides)


def _places(thing: Thing) -> list[tuple[float, float]]:
    """Return the anchors of a thing as (s, d)."""
    if isinstance(thing, Building):
        front = thing.side * thing.front_m
        return [(thing.start_m, front), (thing.end_m, front), (thing.start_m, front)]
    if isinstance(thing, Barrier):
        ends = [(thing.start_m, thing.lateral_m), (thing.end_m, thing.lateral_m)]
        return [*ends, ends[0]]
    foot = (thing.key_m, thing.lateral_m)
    if isinstance(thing, Lamp):
        arm = float(np.copysign(LAMP_ARM_M, thing.lateral_m))
        return [foot, (thing.key_m, thing.lateral_m - arm), foot]
    return [foot] * 3


def _rear_corner(anchors: Points, building: Building) -> Points:
    """Return the corner behind the near end: walls are straight though the street is not."""
    along = anchors[1] - anchors[0]
    outwards = np.array([along[1], -along[0], 0.0]) * building.side
    rear: Points = anchors[0] + outwards * (building.depth_m / np.linalg.norm(along))
    return rear


def _is_hidden_by(building: Building, neighbour: Building | None) -> bool:
    """Return whether the house before it covers its near end wall wholly."""
    if neighbour is None or building.start_m - neighbour.end_m > 0.3:
        return False
    ridge = building.roof_m if building.roof == "ridge" else 0.0
    return (
        neighbour.front_m <= building.front_m + 0.05
        and neighbour.eaves_m >= building.eaves_m + ridge
    )
