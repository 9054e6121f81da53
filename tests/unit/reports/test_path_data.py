"""Path data: few bytes, and every point within half a step of where it was."""

import re

import numpy as np
import pytest

from retraverse.reports.path_data import moved, number_text, path_text, points_of, read_path


@pytest.mark.parametrize(
    ("steps", "text"),
    [(0, "0"), (5, ".5"), (-5, "-.5"), (10, "1"), (-10, "-1"), (123, "12.3"), (-123, "-12.3")],
)
def test_numbers_have_nothing_they_do_not_need(steps: int, text: str) -> None:
    assert number_text(steps, 10) == text


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("M 56 236 \nL 388 236 \n", "M56 236h332"),
        ("M 0 0 \nL 0 3.5 \n", "M0 0v3.5"),
        ("M 1 1 \nL 2 3 \nL 3.04 2 \nL 3 1 \nz\n", "M1 1l1 2 1-1v-1z"),
        # Level pieces are joined, but not where the line turns back.
        ("M 0 5 \nL 1 5 \nL 2 5 \nL 1 5 \n", "M0 5h2-1"),
        # A break: the second piece begins anew.
        ("M 0 0 \nL 1 1 \nM 3 3 \nL 4 4 \n", "M0 0l1 1M3 3l1 1"),
        ("M 0 1 \nC 1 2 3 4 5 6 \n", "M0 1c1 1 3 3 5 5"),
        ("M 1e-05 0 \nQ 1 1 2 0 \n", "M0 0q1 1 2 0"),
        ("", ""),
    ],
)
def test_paths_are_written_in_relative_steps(path: str, text: str) -> None:
    assert path_text(read_path(path), 10) == text


def walked(text: str) -> list[tuple[float, float]]:
    """Return where a pen goes that follows lines in relative steps."""
    here, places = np.zeros(2), []
    for command, values in re.findall(r"([Mlhv])([^Mlhv]*)", text):
        numbers = [float(number) for number in re.findall(r"-?\d*\.?\d+", values)]
        while numbers:
            if command in "Ml":
                step = np.array([numbers.pop(0), numbers.pop(0)])
            else:
                step = numbers.pop(0) * np.array([command == "h", command == "v"])
            here = step if command == "M" else here + step
            places.append((float(here[0]), float(here[1])))
    return places


@pytest.mark.parametrize("seed", range(5))
def test_rounding_does_not_add_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-400, 400, (200, 2))
    line = "M" + "L".join(f" {x:.6f} {y:.6f} \n" for x, y in points)
    assert np.abs(np.array(walked(path_text(read_path(line), 10))) - points).max() < 0.051


def test_a_path_is_moved_as_a_whole() -> None:
    path = read_path("M 0 1 \nL 2 3 \nz\n")
    assert points_of(moved(path, 10, -1)) == [(10, 0), (12, 2)]
    assert path_text(moved(path, 10, -1), 10).endswith("z")
