"""Kinds of districts, and how the houses of each look."""

from dataclasses import dataclass
from typing import Literal

from retraverse.datasets.simulated.things import Colour, RoofKind, WallKind

__all__ = ["ROOF_COLOURS", "STYLES", "TRIMS", "WALL_COLOURS", "District", "Style"]

District = Literal["suburb", "terrace", "town", "modern"]


@dataclass(frozen=True)
class Style:
    """What houses of a district have in common."""

    widths: tuple[float, float]
    storeys: tuple[int, int]
    setbacks: tuple[float, float]
    walls: tuple[WallKind, ...]
    roofs: tuple[RoofKind, ...]
    shops: float
    gap: float
    """Chance that a plot holds no house."""
    spacing: tuple[float, float]
    """Metres between neighbours."""


STYLES: dict[District, Style] = {
    "suburb": Style((9, 13), (1, 2), (3.5, 7.0), ("plaster", "brick", "timber"),
                    ("ridge", "gable", "ridge"), 0.0, 0.14, (2.0, 5.0)),
    "terrace": Style((6, 10), (2, 3), (0.0, 1.6), ("brick", "brick", "plaster"),
                     ("ridge", "ridge", "gable"), 0.12, 0.08, (0.0, 0.0)),
    "town": Style((9, 17), (3, 5), (0.0, 0.6), ("plaster", "plaster", "brick"),
                  ("mansard", "flat", "ridge"), 0.55, 0.07, (0.0, 0.0)),
    "modern": Style((14, 24), (2, 5), (1.0, 5.0), ("panel", "panel", "brick"),
                    ("flat", "flat", "ridge"), 0.35, 0.18, (1.0, 5.0)),
}  # fmt: skip

WALL_COLOURS: dict[WallKind, tuple[Colour, ...]] = {
    "brick": ((150, 84, 66), (172, 108, 82), (128, 78, 68), (186, 150, 112), (118, 96, 88)),
    "plaster": ((222, 208, 178), (206, 186, 160), (196, 202, 196), (214, 180, 140),
                (186, 198, 208), (220, 214, 206), (204, 160, 140), (180, 188, 150)),
    "panel": ((180, 184, 186), (146, 152, 158), (204, 200, 192), (116, 124, 132), (172, 150, 128)),
    "timber": ((176, 190, 200), (206, 200, 178), (146, 104, 78), (120, 140, 132)),
}  # fmt: skip
TRIMS: tuple[Colour, ...] = ((238, 236, 230), (226, 220, 206), (92, 84, 78), (60, 66, 70))
ROOF_COLOURS: tuple[Colour, ...] = ((142, 76, 58), (110, 66, 56), (84, 86, 92), (66, 68, 74),
                                    (120, 104, 92))  # fmt: skip
