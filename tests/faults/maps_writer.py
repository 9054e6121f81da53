"""What the tests of kills run in a process of its own: writers of maps, made to be killed.

``maps_writer.py random FOLDER SEED`` forks a writer for every line it reads, says its number,
and leaves the killing to who reads it. A writer says what it begins and what it has done.
``maps_writer.py points FOLDER FIRST STEP`` kills writers itself, at every STEP-th system call
that changes the disk, looks at what is left, and prints how many it killed.
"""

import json
import os
import random
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.unit.maps.fakes import FakeTechnique, Snapshot, fake_registered, frames, snapshot

from retraverse.errors import DataMissingError
from retraverse.maps import RouteMap, build_map, load_map
from retraverse.maps import segment as segment_room

THUMBNAILS = 16
CHANGING = ("write", "fsync", "replace", "rename", "mkdir", "unlink", "rmdir", "open", "ftruncate")

State = tuple[int, int]
"""Variant of the pictures, number of frames: that decides all of a map."""


def expected(state: State) -> Snapshot:
    """Return what a map in a state must hold."""
    variant, n_frames = state
    drive = frames(n_frames, variant=variant)
    return snapshot(build_map(drive, FakeTechnique(), thumbnails=THUMBNAILS, threads=1))


def build(place: Path, state: State, *, overwrite: bool = False) -> RouteMap:
    variant, n_frames = state
    return build_map(
        frames(n_frames, variant=variant),
        FakeTechnique(),
        path=place,
        thumbnails=THUMBNAILS,
        overwrite=overwrite,
    )


def extend(place: Path, state: State, n_more: int) -> State:
    variant, n_frames = state
    load_map(place).extend(frames(n_more, variant=variant, first=n_frames))
    return variant, n_frames + n_more


def state_of(place: Path) -> State | None:
    """Return the state a map says it is in; None where there is none."""
    try:
        route = load_map(place)
    except DataMissingError:
        return None
    return int(route.frames[0].name.split("-")[0]), len(route)


def write_for_ever(folder: Path, generator: random.Random) -> None:
    """Build, grow and replace maps, saying so."""
    grown = folder / "grown.map"
    state = state_of(grown)
    for number in range(1_000_000):
        if number % 4 == 0:
            fresh = folder / f"fresh-{os.getpid()}-{number}.map"
            new = (number % 7, generator.randint(1, 8))
            say("begin", fresh.name, None, new)
            build(fresh, new)
            say("done", fresh.name, None, new)
        elif state is None or state[1] > 20:
            new = (generator.randint(0, 5), generator.randint(1, 9))
            say("begin", grown.name, state, new)
            build(grown, new, overwrite=True)
            say("done", grown.name, state, new)
            state = new
        else:
            more = generator.randint(1, 5)
            new = (state[0], state[1] + more)
            say("begin", grown.name, state, new)
            state = extend(grown, state, more)
            say("done", grown.name, None, new)


def say(*words: Any) -> None:
    os.write(1, (json.dumps(words) + "\n").encode())


def serve_random(folder: Path, seed: int) -> None:
    for round_number, _ in enumerate(sys.stdin):
        child = os.fork()
        if not child:
            try:
                write_for_ever(folder, random.Random(f"{seed}-{round_number}"))
            finally:
                os._exit(1)
        say("pid", child)
        say("ended", os.waitpid(child, 0)[1])


class Dying:
    """Stands for the system calls that change the disk; the n-th of them kills the process."""

    def __init__(self, fatal: int) -> None:
        self.calls = 0
        self.fatal = fatal

    def wrap(self, name: str, really: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            self.calls += 1
            if self.calls == self.fatal:
                if name == "write":
                    really(args[0], args[1][: len(args[1]) // 2])
                os.kill(os.getpid(), signal.SIGKILL)
            return really(*args, **kwargs)

        return call


def die_at(fatal: int, action: Callable[[], Any]) -> bool:
    """Run `action` in a child that dies at its `fatal`-th call; tell whether it lived."""
    child = os.fork()
    if not child:
        dying = Dying(fatal)
        for name in CHANGING:
            setattr(os, name, dying.wrap(name, getattr(os, name)))
        try:
            action()
        except BaseException:
            os._exit(3)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, f"call {fatal}: failed"
    return not os.WIFSIGNALED(status)


def try_points(
    folder: Path, points: range, old: State | None, new: State, action: Callable[[Path], Any]
) -> int:
    """Kill `action` at all `points` there are, check what is left each time, return how many."""
    contents = {state: None if state is None else expected(state) for state in (old, new)}
    seen: set[State | None] = set()
    for count, point in enumerate(points):
        place = folder / f"{point}" / "route.map"
        place.parent.mkdir()
        if old is not None:
            build(place, old)
        lived = die_at(point, lambda place=place: action(place))  # type: ignore[misc]
        left = state_of(place)
        assert left in contents, f"point {point}: found {left}, expected {old} or {new}"
        if left is not None:
            assert snapshot(load_map(place)) == contents[left], f"point {point}: contents"
        seen.add(left)
        # The next writer works as ever, and leaves nothing of what was interrupted.
        final = build(place, (9, 4), overwrite=True)
        files = [file for file in place.parent.rglob("*") if file.is_file()]
        assert len(files) == 2 + final.info()["n_segments"], f"point {point}: {files}"
        assert list(place.parent.iterdir()) == [place], f"point {point}: leftovers beside it"
        shutil.rmtree(place.parent)
        if lived:
            assert left == new
            assert seen == {old, new}, "no point left both the old and the new"
            return count
    raise AssertionError("it never ended")


def count_points(folder: Path, points: range) -> dict[str, int]:
    import cv2  # noqa: F401  # here rather than in each child

    # A killed process loses nothing that it gave to the system; waiting for the disk is idle.
    os.fsync = lambda fd: None
    folder.mkdir(exist_ok=True)
    return {
        "fresh": try_points(folder, points, None, (0, 5), lambda place: build(place, (0, 5))),
        "extend": try_points(
            folder, points, (0, 4), (0, 9), lambda place: extend(place, (0, 4), 5)
        ),
        "replace": try_points(
            folder, points, (0, 5), (1, 7), lambda place: build(place, (1, 7), overwrite=True)
        ),
        "same again": try_points(
            folder, points, (0, 5), (0, 5), lambda place: build(place, (0, 5), overwrite=True)
        ),
    }


if __name__ == "__main__":
    segment_room.SEGMENT_BYTES = 3 * 900  # three frames with their thumbnails
    with fake_registered():
        if sys.argv[1] == "random":
            serve_random(Path(sys.argv[2]), int(sys.argv[3]))
        else:
            points = range(int(sys.argv[3]), 10_000, int(sys.argv[4]))
            say(count_points(Path(sys.argv[2]), points))
