"""Leftovers of killed writers: whose they are, and when they go."""

from pathlib import Path
from typing import Any

import pytest
from tests.unit.maps.fakes import FakeTechnique, frames, snapshot

from retraverse.maps import build_map, load_map
from retraverse.maps.lock import locked
from retraverse.maps.storage import changing_map

STALE = ("000007.partial", "000003-00112233aabbccdd.safetensors")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    build_map(frames(3), FakeTechnique(), path=tmp_path / "route.map")
    return tmp_path / "route.map"


def leave_behind(place: Path) -> None:
    for name in STALE:
        (place / "segments" / name).write_bytes(b"half")
    (place / "manifest.json.partial").write_bytes(b"half")


def n_files(folder: Path) -> int:
    return sum(file.is_file() for file in folder.rglob("*"))


def test_readers_do_not_mind_leftovers(place: Path) -> None:
    before = snapshot(load_map(place))
    leave_behind(place)
    assert snapshot(load_map(place)) == before


def test_leftovers_go_before_anything_is_written(place: Path) -> None:
    """They may be what fills the disk."""
    leave_behind(place)
    with changing_map(place):
        assert n_files(place) == 3


def test_what_a_killed_first_build_left_goes_although_there_is_a_map_now(place: Path) -> None:
    sibling = place.with_name(".route.map.partial")
    (sibling / "segments").mkdir(parents=True)
    (sibling / "segments" / STALE[0]).write_bytes(b"half")
    load_map(place).extend(frames(1))
    assert not sibling.exists()


def test_a_first_build_at_work_is_not_swept_away(place: Path) -> None:
    sibling = place.with_name(".route.map.partial")
    with locked(sibling, place, create=True):
        load_map(place).extend(frames(1))
        assert sibling.exists()


def test_a_build_over_leftovers_of_a_killed_one(tmp_path: Path) -> None:
    sibling = tmp_path / ".new.map.partial"
    (sibling / "segments").mkdir(parents=True)
    leave_behind(sibling)
    (sibling / "manifest.json").write_bytes(b"whole, but never renamed")
    build_map(frames(2), FakeTechnique(), path=tmp_path / "new.map")
    assert len(load_map(tmp_path / "new.map")) == 2
    assert n_files(tmp_path) == 3
    assert not sibling.exists()


def test_a_leftover_that_cannot_be_removed_is_left_to_the_next(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    leave_behind(place)

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "not now")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refuse)
        load_map(place).extend(frames(1))
    assert len(load_map(place)) == 4
    load_map(place).extend(frames(1))
    assert n_files(place) == 3
