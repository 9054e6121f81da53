"""Maps described by workers: the map that one process alone makes, whoever is first."""

import os
import signal
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import FrameReadError, InputError, RetraverseError
from retraverse.images import Traverse
from retraverse.maps import RouteMap
from retraverse.studies.map_workers import PoolDescriber, describing_by
from retraverse.studies.tasks.workers import Done, ProcessPool, Task, run_task

Item = TypeVar("Item")
N_FRAMES = 75
HOG = {"resolution": 64}


@pytest.fixture
def drive(tmp_path: Path) -> Traverse:
    random = np.random.default_rng(5)
    folder = tmp_path / "drive"
    folder.mkdir()
    for number in range(N_FRAMES):
        picture = random.integers(0, 256, (24, 32, 3), np.uint8)
        cv2.imwrite(str(folder / f"{number:03d}.png"), picture)
    return rt.open_traverse(folder)


class LastFirstPool:
    """Gives back first what was submitted last, and remembers how much it held."""

    sees_files = True
    capacity = 3

    def __init__(self, lost: int = -1) -> None:
        self.waiting: list[tuple[int, Task]] = []
        self.most = 0
        self.lost = lost

    def submit(self, number: int, task: Task) -> None:
        self.waiting.append((number, task))
        self.most = max(self.most, len(self.waiting))

    def next_done(self) -> Done:
        number, task = self.waiting.pop()
        return Done(number, None if number == self.lost else run_task(task))

    def close(self) -> None:
        self.waiting.clear()


def same(one: RouteMap, other: RouteMap) -> bool:
    arrays, others = one.descriptions().arrays, other.descriptions().arrays
    return (
        one.provenance.content_sha256 == other.provenance.content_sha256
        and [*one.frames] == [*other.frames]
        and all(np.array_equal(arrays[name], others[name]) for name in arrays)
        and [one.thumbnail(i) for i in range(len(one))]
        == [other.thumbnail(i) for i in range(len(other))]
    )


def test_the_map_is_the_one_of_this_process(drive: Traverse, tmp_path: Path) -> None:
    technique, metres = rt.technique("hog", **HOG), np.arange(N_FRAMES, dtype=float)
    alone = rt.build_map(drive, technique, thumbnails=16, positions=metres)
    pool = LastFirstPool()
    made = rt.build_map(
        drive,
        technique,
        path=tmp_path / "route.map",
        thumbnails=16,
        positions=metres,
        describer=PoolDescriber(pool),
    )
    assert same(made, alone)
    assert pool.most == 3
    grown = made.extend(drive, positions=metres, describer=PoolDescriber(pool))
    assert same(grown, alone.extend(drive, positions=metres))


def test_worker_processes_one_of_which_is_lost(drive: Traverse) -> None:
    technique, frames = rt.technique("hog", **HOG), tuple(drive) * 4
    pool = ProcessPool(2)

    def kill_one(items: Iterable[Item], *, total: int, label: str) -> Iterator[Item]:
        for number, item in enumerate(items):
            if number == 0:
                os.kill(pool.process_ids[0], signal.SIGKILL)
            yield item

    try:
        made = rt.build_map(frames, technique, describer=PoolDescriber(pool), progress=kill_one)
    finally:
        pool.close()
    assert same(made, rt.build_map(frames, technique))


def test_a_cluster(drive: Traverse) -> None:
    pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    technique = rt.technique("hog", **HOG)
    with describing_by(cluster="local:1") as describer:
        made = rt.build_map(drive, technique, describer=describer)
    assert same(made, rt.build_map(drive, technique))


@pytest.mark.parametrize("by_pool", [False, True])
def test_a_picture_that_cannot_be_read_leaves_nothing(
    drive: Traverse, tmp_path: Path, by_pool: bool
) -> None:
    (tmp_path / "drive" / "040.png").write_bytes(b"no picture")
    describer = PoolDescriber(LastFirstPool()) if by_pool else None
    place = tmp_path / "route.map"
    with pytest.raises(FrameReadError, match=r"040\.png"):
        rt.build_map(drive, rt.technique("sad"), path=place, describer=describer)
    assert not place.exists()


def test_frames_whose_workers_die_are_named(drive: Traverse) -> None:
    describer = PoolDescriber(LastFirstPool(lost=1))
    with pytest.raises(RetraverseError, match=r"032\.png to 063\.png: its worker was lost"):
        rt.build_map(drive, rt.technique("sad"), describer=describer)


def test_what_nobody_else_can_make(drive: Traverse) -> None:
    own = rt.technique_from_callable(
        lambda image: image[:4, :4].ravel().astype(np.float32), name="corner"
    )
    with pytest.raises(InputError, match="workers cannot make it"):
        rt.build_map(drive, own, describer=PoolDescriber(LastFirstPool()))


def test_one_kind_of_worker() -> None:
    with pytest.raises(InputError, match="expected one of them"), describing_by(2, "local:1"):
        pass
    with pytest.raises(InputError, match="got 0, expected 1 or more"), describing_by(0):
        pass
    with describing_by() as describer:
        assert describer is None
