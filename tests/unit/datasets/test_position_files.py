"""Positions from CSV tables."""

from pathlib import Path

import numpy as np
import pytest

from retraverse.datasets import load_positions
from retraverse.errors import DataMissingError, InputError


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_one_or_two_columns(tmp_path: Path) -> None:
    along = write(tmp_path / "a.csv", "frame,position_m\n0,1.5\n1,\n2,4\n")
    np.testing.assert_array_equal(load_positions(along), [[1.5], [np.nan], [4]])
    plane = write(tmp_path / "b.csv", "north_m,east_m\n1,2\n3,4\n")
    np.testing.assert_array_equal(load_positions(plane), [[2, 1], [4, 3]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "got columns a, b; expected position_m"),
        ("", "got columns none"),
        ("position_m\n1\nfar\n", "line 3: got 'far'"),
        ("position_m\n1\ninf\n", "line 3: got 'inf'"),
    ],
)
def test_refuses(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_positions(write(tmp_path / "p.csv", text))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError):
        load_positions(tmp_path / "none.csv")
