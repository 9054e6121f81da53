"""One procedurally made street: districts, plots, houses, gardens, side streets, furniture.

The street is made plot by plot from its start on each side, every thing from a seed of its
own, so a longer street begins like a shorter one with the same seed.

Cross-section, metres from the centre line: lane to 3.2, parked cars to 5.4, kerb, pavement to
8.4, then plots. Traffic keeps right.
"""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from retraverse.datasets.simulated.path import CentreLine, make_centre_line
from retraverse.datasets.simulated.styles import (
    ROOF_COLOURS,
    STYLES,
    TRIMS,
    WALL_COLOURS,
    District,
    Style,
)
from retraverse.datasets.simulated.things import (
    Barrier,
    BarrierKind,
    Building,
    Colour,
    Ground,
    Lamp,
    ParkedCar,
    Sign,
    Thing,
    Tree,
    TreeKind,
)
from retraverse.errors import ConfigError

__all__ = ["FRONT_M", "KERB_M", "LANE_M", "VIEW_M", "Street", "make_street"]

LANE_M, KERB_M, FRONT_M = 3.2, 5.4, 8.4
VIEW_M = 190.0
"""How far ahead things are painted."""
DISTRICT_M = 85.0


@dataclass(frozen=True, eq=False)
class Street:
    """A street from 0 to `length_m` with its surroundings; see `make_street`."""

    seed: int
    length_m: float
    line: CentreLine
    sun_azimuth: float
    """Direction the sun stands in, radians, in the world."""
    things: tuple[Thing, ...]
    """Sorted by `key_m`."""
    grounds: tuple[Ground, ...]
    """Sorted by start."""

    def things_between(self, start_m: float, end_m: float) -> tuple[Thing, ...]:
        """Return the things with `start_m <= key_m < end_m`, near to far."""
        low = bisect_left(self.things, start_m, key=lambda thing: thing.key_m)
        high = bisect_left(self.things, end_m, key=lambda thing: thing.key_m)
        return self.things[low:high]

    def lamps_near(self, s: float, reach_m: float = 32.0) -> tuple[Lamp, ...]:
        """Return the street lamps within `reach_m` along the street."""
        near = self.things_between(s - reach_m, s + reach_m)
        return tuple(thing for thing in near if isinstance(thing, Lamp))

    def grounds_between(self, start_m: float, end_m: float) -> tuple[Ground, ...]:
        """Return the plots' grounds that overlap the stretch."""
        low = bisect_left(self.grounds, start_m - 40.0, key=lambda ground: ground.start_m)
        high = bisect_left(self.grounds, end_m, key=lambda ground: ground.start_m)
        return tuple(ground for ground in self.grounds[low:high] if ground.end_m > start_m)


def make_street(seed: int = 0, length_m: float = 240.0) -> Street:
    """Make a street.

    Parameters
    ----------
    seed : int >= 0
        Same seed, same street.
    length_m : float in [10, 100000]
        Length of the route; the street goes on beyond it, so that there is always a view.

    Returns
    -------
    Street

    Raises
    ------
    ConfigError
        `seed` is negative or `length_m` is out of range.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ConfigError(f"street seed is {seed!r}; expected an integer from 0")
    if not 10.0 <= length_m <= 1e5:
        raise ConfigError(f"street length_m is {length_m!r}; expected 10 to 100000 metres")
    line = make_centre_line(seed, length_m)
    things: list[Thing] = []
    grounds: list[Ground] = []
    end = length_m + VIEW_M + 60.0
    for side in (-1, 1):
        for plot in _plots(seed, side, end):
            things += plot.things
            grounds += plot.grounds
        things += _kerbside(seed, side, end, [g for g in grounds if g.side == side])
    turn = np.random.default_rng([seed, 2]).choice([-1.0, 1.0]) * 1.15
    return Street(
        seed=seed,
        length_m=length_m,
        line=line,
        sun_azimuth=float(line.heading_at(0.0)) + float(turn),
        things=tuple(sorted(things, key=lambda thing: thing.key_m)),
        grounds=tuple(sorted(grounds, key=lambda ground: ground.start_m)),
    )


@dataclass(frozen=True)
class _Plot:
    end_m: float
    things: list[Thing]
    grounds: list[Ground]


def district_at(seed: int, s: float) -> District:
    """Return the kind of district at `s`; both sides of the street share it."""
    k = int(s // DISTRICT_M) + 8
    rng = np.random.default_rng([seed, 3, max(k, 0)])
    names: tuple[District, ...] = ("suburb", "terrace", "town", "modern")
    return names[int(rng.choice(4, p=[0.3, 0.27, 0.27, 0.16]))]


def _plots(seed: int, side: int, end_m: float) -> Iterator[_Plot]:
    """Yield the plots of one side in order; after an opening comes a corner house."""
    s, index, was_opening = -60.0, 0, False
    while s < end_m:
        rng = np.random.default_rng([seed, 4, side + 1, index])
        style = STYLES[district_at(seed, s)]
        is_opening = not was_opening and rng.random() < style.gap
        make = _open_plot if is_opening else _house_plot
        plot = make(rng, side, s, style, was_opening)
        yield plot
        s, index, was_opening = plot.end_m, index + 1, is_opening


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _pick_colour(rng: np.random.Generator, colours: tuple[Colour, ...]) -> Colour:
    """Return one of the colours, shifted a little, so that no two houses are quite alike."""
    base = np.array(colours[int(rng.integers(len(colours)))]) + rng.normal(0, 7, 3)
    red, green, blue = (int(value) for value in np.clip(base, 20, 244))
    return red, green, blue


def _house(
    rng: np.random.Generator, side: int, start: float, style: Style, is_corner: bool
) -> Building:
    """Return one house of the district's style."""
    wall = style.walls[int(rng.integers(len(style.walls)))]
    roof = style.roofs[int(rng.integers(len(style.roofs)))]
    width = float(rng.uniform(*style.widths))
    depth = float(rng.uniform(9, 13)) * (2.3 if is_corner else 1.0)
    is_low = style.storeys[1] <= 2
    pitch = {"flat": 0.0, "mansard": 2.6, "gable": 0.42 * width, "ridge": 3.4}[roof]
    ground_floor: Literal["home", "shop", "garage"] = "home"
    if rng.random() < style.shops:
        ground_floor = "shop"
    elif is_low and rng.random() < 0.35:
        ground_floor = "garage"
    return Building(
        seed=_seed(rng), side=side, start_m=start, end_m=start + width,
        front_m=FRONT_M + float(rng.uniform(*style.setbacks)), depth_m=depth,
        storeys=int(rng.integers(style.storeys[0], style.storeys[1] + 1)),
        storey_m=float(rng.uniform(2.8, 3.5)), wall=wall,
        colour=_pick_colour(rng, WALL_COLOURS[wall]), trim=_pick_colour(rng, TRIMS), roof=roof,
        roof_colour=_pick_colour(rng, ROOF_COLOURS), roof_m=pitch * float(rng.uniform(0.8, 1.15)),
        ground_floor=ground_floor, is_corner=is_corner,
    )  # fmt: skip


def _house_plot(
    rng: np.random.Generator, side: int, s: float, style: Style, is_corner: bool
) -> _Plot:
    """Return a plot with a house, its garden or forecourt, and what bounds it."""
    space = float(rng.uniform(*style.spacing))
    house = _house(rng, side, s + space / 2, style, is_corner)
    end = house.end_m + space / 2
    things: list[Thing] = [house]
    setback = house.front_m - FRONT_M
    kind: Literal["grass", "paving"] = "grass" if setback > 2.5 else "paving"
    if setback > 0.9:
        things += _front_garden(rng, house, s, end)
    if space > 3.0 or house.storeys == 1:
        things.append(_backdrop(rng, side, s, style))
    return _Plot(end, things, [Ground(side, s, end, kind, FRONT_M)])


def _front_garden(
    rng: np.random.Generator, house: Building, start: float, end: float
) -> list[Thing]:
    """Return the barrier with a gate, and bushes or a small tree behind it."""
    side, depth = house.side, house.front_m - FRONT_M
    kinds: tuple[BarrierKind, ...] = ("hedge", "pickets", "wall", "railing")
    kind = kinds[int(rng.choice(4, p=[0.38, 0.22, 0.22, 0.18]))]
    height = float(rng.uniform(0.7, 1.5) if kind == "hedge" else rng.uniform(0.7, 1.1))
    colour = _pick_colour(rng, ((150, 96, 78), (206, 200, 190), (170, 164, 152)))
    gate = float(rng.uniform(start + 1.5, end - 3.5))
    barrier_seed = _seed(rng)
    things: list[Thing] = [
        Barrier(barrier_seed, kind, a, b, side * (FRONT_M + 0.15), height, colour)
        for a, b in ((start + 0.1, gate), (gate + 1.6, end - 0.1))
        if b - a > 0.6
    ]
    if depth > 2.0:
        for _ in range(int(rng.integers(1, 4))):
            is_bush = rng.random() < 0.7
            tree_kind: TreeKind = "bush" if is_bush else ("slender" if depth < 5 else "conifer")
            things.append(Tree(
                _seed(rng), tree_kind, float(rng.uniform(start + 1, end - 1)),
                side * (FRONT_M + float(rng.uniform(1.0, depth - 0.8))),
                float(rng.uniform(1.2, 2.2) if is_bush else rng.uniform(4, 7)),
            ))  # fmt: skip
    return things


def _backdrop(rng: np.random.Generator, side: int, s: float, style: Style) -> Building:
    """Return a house of the second row."""
    house = _house(rng, side, s, style, False)
    far = float(rng.uniform(30, 44))
    fields = {**house.__dict__, "front_m": far, "is_backdrop": True, "ground_floor": "home"}
    return Building(**fields)


def _open_plot(rng: np.random.Generator, side: int, s: float, style: Style, _: bool) -> _Plot:
    """Return a side street, a park, or a yard, with houses of the second row behind."""
    kind = str(rng.choice(["side_street", "park", "yard"], p=[0.5, 0.3, 0.2]))
    width = float(rng.uniform(8, 10) if kind == "side_street" else rng.uniform(12, 24))
    things: list[Thing] = [_backdrop(rng, side, s - 6 + 11 * i, style) for i in range(3)]
    if kind == "park":
        things += _park(rng, side, s, width)
        return _Plot(s + width, things, [Ground(side, s, s + width, "grass", FRONT_M)])
    if kind == "yard":
        barrier: BarrierKind = "wall" if rng.random() < 0.5 else "railing"
        things.append(Barrier(_seed(rng), barrier, s + 0.2, s + width - 4.5,
                              side * (FRONT_M + 0.2), 1.7, _pick_colour(rng, TRIMS)))  # fmt: skip
        return _Plot(s + width, things, [Ground(side, s, s + width, "asphalt", FRONT_M)])
    things.append(Sign(_seed(rng), "triangle", s - 0.8, side * (FRONT_M - 1.4)))
    return _Plot(s + width, things, [Ground(side, s, s + width, "asphalt", KERB_M)])


def _park(rng: np.random.Generator, side: int, s: float, width: float) -> list[Thing]:
    """Return the trees of a small park behind a low hedge or railing."""
    kinds: tuple[TreeKind, ...] = ("broadleaf", "broadleaf", "slender", "conifer")
    trees: list[Thing] = [
        Tree(_seed(rng), kinds[int(rng.integers(4))], s + float(rng.uniform(1, width - 1)),
             side * float(rng.uniform(11, 26)), float(rng.uniform(6, 11)))
        for _ in range(int(width / 2.6))
    ]  # fmt: skip
    barrier: BarrierKind = "hedge" if rng.random() < 0.5 else "railing"
    return [*trees, Barrier(_seed(rng), barrier, s + 0.3, s + width - 0.3,
                            side * (FRONT_M + 0.2), 0.9, (60, 70, 64))]  # fmt: skip


def _kerbside(seed: int, side: int, end_m: float, grounds: list[Ground]) -> list[Thing]:
    """Return what stands at the kerb: lamps, trees, parked cars, signs; none in side streets."""
    openings = [(g.start_m, g.end_m) for g in grounds if g.front_m < FRONT_M]

    def is_free(s: float) -> bool:
        return not any(a - 1.5 < s < b + 1.5 for a, b in openings)

    things: list[Thing] = [
        *_lamps(seed, side, end_m),
        *_street_trees(seed, side, end_m),
        *_parked_cars(seed, side, end_m),
        *_signs(seed, side, end_m),
    ]
    margin = 3.0
    return [
        thing
        for thing in things
        if is_free(thing.key_m)
        and not (isinstance(thing, ParkedCar) and not is_free(thing.key_m + margin))
    ]


def _lamps(seed: int, side: int, end_m: float) -> Iterator[Lamp]:
    for k, s in enumerate(np.arange(-40.0 + 13.0 * (side > 0), end_m, 27.0)):
        shift = np.random.default_rng([seed, 5, side + 1, k]).uniform(-3, 3)
        yield Lamp(float(s + shift), side * (KERB_M + 0.55))


def _street_trees(seed: int, side: int, end_m: float) -> Iterator[Tree]:
    """Yield trees of one kind per district, where the district has any on this side."""
    for k, s in enumerate(np.arange(-50.0, end_m, 9.5)):
        district = int(s // DISTRICT_M) + 8
        common = np.random.default_rng([seed, 6, side + 1, district])
        has_trees, kind_draw = common.random() < 0.6, common.random()
        rng = np.random.default_rng([seed, 7, side + 1, k])
        if has_trees and rng.random() < 0.8:
            kind: TreeKind = "broadleaf" if kind_draw < 0.7 else "slender"
            yield Tree(_seed(rng), kind, float(s + rng.uniform(-1.5, 1.5)),
                       side * (KERB_M + 1.0), float(rng.uniform(5.0, 9.0)))  # fmt: skip


def _parked_cars(seed: int, side: int, end_m: float) -> Iterator[ParkedCar]:
    for k, s in enumerate(np.arange(-40.0, end_m, 6.4)):
        rng = np.random.default_rng([seed, 8, side + 1, k])
        district = np.random.default_rng([seed, 9, side + 1, int(s // 45) + 8])
        is_taken = bool(rng.random() < district.uniform(0.1, 0.75))
        lateral = side * (KERB_M - 1.12 + float(rng.normal(0, 0.06)))
        yield ParkedCar(_seed(rng), float(s + rng.uniform(-0.4, 0.4)), lateral, is_taken)


def _signs(seed: int, side: int, end_m: float) -> Iterator[Sign]:
    kinds: tuple[Literal["round", "triangle", "square", "bin", "bollard", "cabinet"], ...]
    kinds = ("round", "triangle", "square", "bin", "bollard", "cabinet")
    for k, s in enumerate(np.arange(-40.0, end_m, 11.0)):
        rng = np.random.default_rng([seed, 10, side + 1, k])
        if rng.random() < 0.6:
            kind = kinds[int(rng.integers(6))]
            inner = kind not in ("bin", "cabinet")
            lateral = KERB_M + 0.4 if inner else FRONT_M - 0.5
            yield Sign(_seed(rng), kind, float(s + rng.uniform(-4, 4)), side * lateral)
