"""Path data of SVG: read as matplotlib writes it, written in as few bytes as it looks the same in.

Conventions
- Coordinates are whole multiples of a step, 1 / `scale` SVG units: what is written is exactly
  what was rounded, so relative steps do not add up to an error.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

__all__ = ["Segment", "moved", "number_text", "path_text", "points_of", "read_path"]

_PAIRS = {"M": 1, "L": 1, "Q": 2, "C": 3, "z": 0}
"""Points that follow each command."""


@dataclass(frozen=True)
class Segment:
    """One command of a path with its points, absolute."""

    command: str
    """``"M"``, ``"L"``, ``"Q"``, ``"C"`` or ``"z"``."""
    points: tuple[tuple[float, float], ...]


def read_path(text: str) -> tuple[Segment, ...]:
    """Return the segments of a path in absolute commands, one letter each."""
    tokens = iter(re.findall(r"[A-Za-z]|-?[\d.]+(?:e-?\d+)?", text))
    return tuple(
        Segment(
            command,
            tuple((float(next(tokens)), float(next(tokens))) for _ in range(_PAIRS[command])),
        )
        for command in tokens
    )


def moved(path: Iterable[Segment], x: float, y: float) -> tuple[Segment, ...]:
    """Return a path moved by (x, y)."""
    return tuple(
        Segment(segment.command, tuple((x + px, y + py) for px, py in segment.points))
        for segment in path
    )


def points_of(path: Iterable[Segment]) -> list[tuple[float, float]]:
    """Return all points of a path, control points among them."""
    return [point for segment in path for point in segment.points]


def number_text(steps: int, scale: int) -> str:
    """Return a number of steps without what it does not need: 5 tenths -> ".5"."""
    if steps % scale == 0:
        return str(steps // scale)
    text = f"{abs(steps) / scale:.{len(str(scale)) - 1}f}".rstrip("0").removeprefix("0")
    return f"-{text}" if steps < 0 else text


def path_text(path: Iterable[Segment], scale: int) -> str:
    """Return a path in relative commands, rounded to 1 / `scale`.

    Points on a level line between its ends are left out: at 100 % there are many.
    """
    written, letter = "", ""
    for command, values in _without_middles(_relative(path, scale)):
        numbers = [number_text(value, scale) for value in values]
        text = "".join(number if number[0] == "-" else f" {number}" for number in numbers)
        repeated = command == letter and values
        written += text if repeated else command + text.removeprefix(" ")
        letter = command
    return written


def _relative(path: Iterable[Segment], scale: int) -> Iterator[tuple[str, list[int]]]:
    """Give (command, values): moves absolute, all else relative to where the pen is."""
    here = start = (0, 0)
    for segment in path:
        points = [(round(scale * x), round(scale * y)) for x, y in segment.points]
        if segment.command == "z":
            here = start
            yield "z", []
        elif segment.command == "M":
            here = start = points[0]
            yield "M", [*here]
        else:
            steps = [step for x, y in points for step in (x - here[0], y - here[1])]
            here = points[-1]
            yield _step(segment.command.lower(), steps)


def _step(command: str, steps: list[int]) -> tuple[str, list[int]]:
    """Return a command and its values, a level or upright line as such."""
    if command == "l" and not steps[1]:
        return "h", steps[:1]
    return ("v", steps[1:]) if command == "l" and not steps[0] else (command, steps)


def _without_middles(commands: Iterable[tuple[str, list[int]]]) -> Iterator[tuple[str, list[int]]]:
    """Join level steps that go on in the same direction."""
    waiting: list[int] = []
    for command, values in commands:
        if command == "h" and waiting and waiting[0] * values[0] >= 0:
            waiting = [waiting[0] + values[0]]
            continue
        if waiting:
            yield "h", waiting
        waiting = values if command == "h" else []
        if command != "h":
            yield command, values
    if waiting:
        yield "h", waiting
