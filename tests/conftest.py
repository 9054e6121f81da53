"""Fixtures every test shares: where real data lies, and how heavy a heavy test is."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

# New examples at every run at a desk, the same ones in continuous integration; a failure prints
# what reproduces it. No deadline: machines are shared, and speed has benchmarks.
settings.register_profile("desk", deadline=None, print_blob=True)
settings.register_profile("ci", deadline=None, print_blob=True, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") == "true" else "desk")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Callable[[str], Path]:
    """Return a function that finds real data beside the project, or skips the test."""

    def find(relative: str) -> Path:
        data = os.environ.get("RETRAVERSE_DATA")
        base = Path(data).resolve().parent if data else ROOT.parent / "shared"
        path = base / relative
        if not path.exists():
            pytest.skip(f"real data {relative} is not here; set RETRAVERSE_DATA to its folder")
        return path

    return find


@pytest.fixture(scope="session")
def scaled() -> Callable[[int], int]:
    """Return a function that scales a heavy test's count by RETRAVERSE_SCALE (1 = in full)."""
    scale = float(os.environ.get("RETRAVERSE_SCALE", "0.2"))
    return lambda count: max(1, round(count * scale))
