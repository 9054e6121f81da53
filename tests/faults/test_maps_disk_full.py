"""A full disk, or Ctrl-C, at any system call leaves the old map or the new one and no litter."""

import errno
import os
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.faults import maps_writer
from tests.unit.maps.fakes import FakeTechnique, fake_registered, frames, snapshot

from retraverse.errors import MapError
from retraverse.maps import build_map, load_map
from retraverse.maps import segment as segment_room

WRITING = ("write", "fsync", "replace", "rename", "mkdir")
OLD, NEW = (0, 4), (0, 9)
ACTIONS: dict[str, tuple[maps_writer.State | None, Callable[[Path], Any]]] = {
    "fresh": (None, lambda place: maps_writer.build(place, NEW)),
    "extend": (OLD, lambda place: maps_writer.extend(place, OLD, 5)),
    "replace": (OLD, lambda place: maps_writer.build(place, NEW, overwrite=True)),
    "save": (None, lambda place: in_memory().save(place)),
}


def in_memory() -> Any:
    return build_map(frames(9), FakeTechnique(), thumbnails=maps_writer.THUMBNAILS)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(segment_room, "SEGMENT_BYTES", 3 * 900)
    with fake_registered():
        yield


class Failing:
    """Lets a system call fail the n-th time, having done half of what it should."""

    def __init__(self, fatal: int, error: Callable[[], BaseException], *, for_ever: bool) -> None:
        self.calls = 0
        self.fatal = fatal
        self.error = error
        self.for_ever = for_ever

    @property
    def failed(self) -> bool:
        return self.calls >= self.fatal

    def wrap(self, name: str, really: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            self.calls += 1
            if self.calls == self.fatal or (self.for_ever and self.failed):
                if name == "write":
                    really(args[0], args[1][: len(args[1]) // 2])
                raise self.error()
            return really(*args, **kwargs)

        return call


def no_space() -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def listing(folder: Path) -> set[Path]:
    return {file for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("for_ever", [False, True], ids=["once", "for ever"])
@pytest.mark.parametrize("error", [no_space, KeyboardInterrupt], ids=["disk full", "Ctrl-C"])
@pytest.mark.parametrize("action", ACTIONS)
def test_failure_at_every_system_call(
    action: str, error: Callable[[], BaseException], for_ever: bool, tmp_path: Path
) -> None:
    old, act = ACTIONS[action]
    contents = {state: state and maps_writer.expected(state) for state in (old, NEW)}
    for fatal in range(1, 1000):
        place = tmp_path / str(fatal) / "route.map"
        place.parent.mkdir()
        if old is not None:
            maps_writer.build(place, old)
        failing = Failing(fatal, error, for_ever=for_ever)
        with pytest.MonkeyPatch.context() as patch:
            for name in WRITING:
                patch.setattr(os, name, failing.wrap(name, getattr(os, name)))
            caught = outcome(act, place)
        left = maps_writer.state_of(place)
        if not failing.failed:
            assert caught is None
            assert left == NEW
            assert fatal > 15, "there must be more to fail than this"
            return
        check_message(caught, error)
        assert left in contents
        assert (left and snapshot(load_map(place))) == contents[left]
        n_segments = 0 if left is None else load_map(place).info()["n_segments"]
        n_files = 0 if left is None else 2 + n_segments
        assert len(listing(place.parent)) == n_files, f"call {fatal}: {listing(place.parent)}"
        assert list(place.parent.iterdir()) == ([place] if left else [])
    raise AssertionError("it never ended")


def outcome(act: Callable[[Path], Any], place: Path) -> BaseException | None:
    try:
        act(place)
    except BaseException as caught:
        return caught
    return None


def check_message(caught: BaseException | None, error: Callable[[], BaseException]) -> None:
    if error is KeyboardInterrupt:
        assert isinstance(caught, KeyboardInterrupt)
        return
    assert isinstance(caught, MapError)
    assert "No space left on device" in str(caught)
    assert "route.map" in str(caught)
    assert "\n" not in str(caught)


@pytest.mark.parametrize("action", ACTIONS)
def test_a_limit_on_the_size_of_files(action: str, tmp_path: Path) -> None:
    old, act = ACTIONS[action]
    refused = 0
    for limit in range(100, 5000, 350):
        place = tmp_path / str(limit) / "route.map"
        place.parent.mkdir()
        if old is not None:
            maps_writer.build(place, old)
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        try:
            caught = outcome(act, place)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        left = maps_writer.state_of(place)
        assert left == (NEW if caught is None else old)
        if caught is not None:
            refused += 1
            assert isinstance(caught, MapError)
            assert "File too large" in str(caught)
            n_files = 0 if left is None else 2 + load_map(place).info()["n_segments"]
            assert len(listing(place.parent)) == n_files
    assert 2 < refused < 14, "some limits must be too low, some high enough"


def test_system_calls_that_write_less_than_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    really = os.write
    monkeypatch.setattr(os, "write", lambda file, content: really(file, content[:7]))
    route = maps_writer.build(tmp_path / "a", NEW)
    assert snapshot(load_map(tmp_path / "a")) == snapshot(route) == maps_writer.expected(NEW)


@pytest.mark.parametrize("action", ACTIONS)
def test_all_is_on_the_disk_before_the_change(
    action: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Power may fail too: what the manifest names is flushed before it, and it before its name."""
    if not Path("/proc/self/fd").exists():
        pytest.skip("no /proc to see which file a descriptor is")
    old, act = ACTIONS[action]
    place = tmp_path / "route.map"
    if old is not None:
        maps_writer.build(place, old)
    done: list[tuple[str, Path]] = []
    fsync, replace, write = os.fsync, os.replace, os.write

    def path_of(file: int) -> Path:
        return Path(f"/proc/self/fd/{file}").readlink()

    def logged_fsync(file: int) -> None:
        done.append(("flushed", path_of(file)))
        fsync(file)

    def logged_replace(source: Path, target: Path) -> None:
        done.append(("renamed", Path(target)))
        assert last(("flushed", Path(source))) > last(("written", Path(source)))
        replace(source, target)

    def logged_write(file: int, content: Any) -> int:
        done.append(("written", path_of(file)))
        return write(file, content)

    def last(event: tuple[str, Path]) -> int:
        return max(index for index, other in enumerate(done) if other == event)

    monkeypatch.setattr(os, "fsync", logged_fsync)
    monkeypatch.setattr(os, "replace", logged_replace)
    monkeypatch.setattr(os, "write", logged_write)
    act(place)
    folder = place if old is not None else tmp_path / ".route.map.partial"
    change = last(("renamed", folder / "manifest.json"))
    segments = [i for i, (_, path) in enumerate(done) if path.parent == folder / "segments"]
    assert len(segments) >= 3
    assert max(segments) < last(("flushed", folder / "segments")) < change
    assert change < last(("flushed", folder))
    if old is None:
        assert last(("flushed", folder)) < last(("flushed", tmp_path))
