"""What stands along a street: plain records, each with the seed of its own details.

Every thing has `key_m`, the place along the street by which things are painted from far to
near; a thing with an extent takes its far end.
"""

from dataclasses import dataclass
from typing import Literal

__all__ = [
    "Barrier",
    "BarrierKind",
    "Building",
    "Ground",
    "Lamp",
    "ParkedCar",
    "RoofKind",
    "Sign",
    "Thing",
    "Tree",
    "TreeKind",
    "WallKind",
]

Colour = tuple[int, int, int]
"""RGB, 0..255, as seen in full light."""
WallKind = Literal["brick", "plaster", "panel", "timber"]
RoofKind = Literal["flat", "ridge", "gable", "mansard"]
TreeKind = Literal["broadleaf", "slender", "conifer", "bush"]
BarrierKind = Literal["hedge", "pickets", "wall", "railing"]


@dataclass(frozen=True)
class Building:
    """A house whose front faces the street."""

    seed: int
    side: int
    """-1 left of the street, 1 right of it."""
    start_m: float
    end_m: float
    front_m: float
    """Distance of the front from the centre line."""
    depth_m: float
    storeys: int
    storey_m: float
    wall: WallKind
    colour: Colour
    trim: Colour
    roof: RoofKind
    roof_colour: Colour
    roof_m: float
    """Height of the roof above the eaves."""
    ground_floor: Literal["home", "shop", "garage"]
    is_corner: bool = False
    """Beside an opening: its end wall is seen from afar and has windows."""
    is_backdrop: bool = False
    """A house in the second row, painted coarsely."""

    @property
    def eaves_m(self) -> float:
        """Height of the walls."""
        return self.storeys * self.storey_m + 0.5

    @property
    def key_m(self) -> float:
        """Place by which it is painted."""
        return self.end_m


@dataclass(frozen=True)
class Ground:
    """What covers the ground of one plot between the pavement and the second row."""

    side: int
    start_m: float
    end_m: float
    kind: Literal["grass", "paving", "asphalt"]
    front_m: float
    """Where it begins, from the centre line."""


@dataclass(frozen=True)
class Tree:
    """A tree or bush."""

    seed: int
    kind: TreeKind
    key_m: float
    lateral_m: float
    height_m: float


@dataclass(frozen=True)
class Lamp:
    """A street lamp on the pavement with its arm over the road."""

    key_m: float
    lateral_m: float
    height_m: float = 6.2


@dataclass(frozen=True)
class ParkedCar:
    """A place at the kerb; whether a car stands there can change with traffic."""

    seed: int
    key_m: float
    lateral_m: float
    is_taken: bool
    """In the undisturbed street."""


@dataclass(frozen=True)
class Sign:
    """A post with a plate, or a small thing on the pavement."""

    seed: int
    kind: Literal["round", "triangle", "square", "bin", "bollard", "cabinet"]
    key_m: float
    lateral_m: float


@dataclass(frozen=True)
class Barrier:
    """A hedge, fence, wall or railing along the front of a plot."""

    seed: int
    kind: BarrierKind
    start_m: float
    end_m: float
    lateral_m: float
    height_m: float
    colour: Colour

    @property
    def key_m(self) -> float:
        """Just in front of the house of the same plot."""
        return self.end_m - 0.02


Thing = Building | Tree | Lamp | ParkedCar | Sign | Barrier
