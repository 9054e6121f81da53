"""Data walks one corridor: a module imports only from its own room and rooms before it."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src" / "retraverse"
CORRIDOR = (
    ("errors", "types", "_version"),
    ("files", "registry"),
    ("kernels",),
    ("images",),
    ("datasets",),
    ("metrics",),
    ("weights",),
    ("techniques",),
    ("maps",),
    ("matching",),
    ("localization",),
    ("studies",),
    ("reports", "planning", "training"),
    ("node",),
    ("cli",),
)
ROOM_ORDER = {room: order for order, rooms in enumerate(CORRIDOR) for room in rooms}
MODULES = [path for path in sorted(SOURCE.rglob("*.py")) if path != SOURCE / "__init__.py"]


def imported_rooms(path: Path) -> set[str]:
    rooms = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        rooms |= {name.split(".")[1] for name in names if name.startswith("retraverse.")}
    return rooms


def room_of(path: Path) -> str:
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_module_imports_only_from_the_left(path: Path) -> None:
    here = room_of(path)
    assert here in ROOM_ORDER, f"{here} has no place in the corridor"
    for room in imported_rooms(path):
        allowed = room == here or ROOM_ORDER[room] < ROOM_ORDER[here]
        assert allowed, f"{path.name} in {here} imports {room}, which lies to the right"


def test_the_test_sees_a_wrong_import(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text("from retraverse.cli import main\nimport retraverse.maps.storage\n")
    assert imported_rooms(wrong) == {"cli", "maps"}
