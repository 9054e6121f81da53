"""The scripts in examples/ run as a user runs them."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
QUICKLY = {
    "simulated_route.py": ["--frames", "8", "--steps", "1"],
    "simulated_sheet.py": ["sheet.jpg", "--places", "1", "--columns", "1"],
}
"""Every example, with the words that make it short."""


def run(name: str, folder: Path) -> str:
    """Run an example in a folder and return what it printed."""
    command = [sys.executable, "-W", "error", str(EXAMPLES / name), *QUICKLY[name]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_no_example_is_left_out() -> None:
    assert sorted(QUICKLY) == sorted(path.name for path in EXAMPLES.glob("*.py"))


def test_simulated_route(tmp_path: Path) -> None:
    lines = run("simulated_route.py", tmp_path).splitlines()
    assert lines[-1].split() == ["0.00", "100.0%", "100.0%"], "undisturbed, all is found"


def test_simulated_sheet(tmp_path: Path) -> None:
    assert "sheet.jpg" in run("simulated_sheet.py", tmp_path)
    with Image.open(tmp_path / "sheet.jpg") as sheet:
        assert min(sheet.size) > 140


@pytest.mark.parametrize("name", sorted(QUICKLY))
def test_an_example_says_how_to_run_it(name: str) -> None:
    assert f"python examples/{name}" in (EXAMPLES / name).read_text(encoding="utf-8")
