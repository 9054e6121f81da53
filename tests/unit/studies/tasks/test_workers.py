"""Worker processes that are lost while they start: tried again, and given up in the end."""

import os
import signal
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import RetraverseError
from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.studies.tasks.frames_task import DescribedFrames, FramesTask
from retraverse.studies.tasks.workers import MOST_ATTEMPTS, Done, ProcessPool


@pytest.fixture
def task(tmp_path: Path) -> FramesTask:
    folder = tmp_path / "drive"
    folder.mkdir()
    random = np.random.default_rng(7)
    cv2.imwrite(str(folder / "0.png"), random.integers(0, 256, (24, 32, 3), np.uint8))
    return FramesTask(tuple(rt.open_traverse(folder)), TechniqueChoice("sad", {}), None)


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of the user's, imported by every worker as it starts."""
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / "users_module.py"


def answer_of(pool: ProcessPool, task: FramesTask) -> Done:
    try:
        pool.submit(0, task)
        return pool.next_done()
    finally:
        pool.close()


def test_a_worker_killed_while_it_starts_costs_time_only(task: FramesTask, module: Path) -> None:
    # It waits in its start until it is killed, so that it never is ready: no race.
    module.write_text(
        "import pathlib, time\n"
        "first = pathlib.Path(__file__).with_name('first')\n"
        "if not first.exists():\n"
        "    first.touch()\n"
        "    time.sleep(60)\n"
    )
    pool = ProcessPool(1, ["users_module"])
    (started,) = pool.process_ids
    while not module.with_name("first").exists():
        time.sleep(0.01)
    os.kill(started, signal.SIGKILL)
    done = answer_of(pool, task)
    assert isinstance(done.outcome, DescribedFrames)
    assert done.outcome.error is None
    assert len(done.outcome.frames) == 1


def test_a_worker_that_never_gets_ready_is_given_up(task: FramesTask, module: Path) -> None:
    module.write_text(
        "import os, pathlib\n"
        "with pathlib.Path(__file__).with_name('starts').open('a') as starts:\n"
        "    starts.write('x')\n"
        "os._exit(7)\n"
    )
    with pytest.raises(RetraverseError, match=r"lost 3 times before it was ready \(exit code 7"):
        answer_of(ProcessPool(1, ["users_module"]), task)
    assert len(module.with_name("starts").read_text()) == MOST_ATTEMPTS


def test_a_worker_that_says_why_is_not_tried_again(task: FramesTask, module: Path) -> None:
    module.write_text("raise ValueError('no such camera')\n")
    with pytest.raises(RetraverseError, match="cannot start: ValueError: no such camera"):
        answer_of(ProcessPool(1, ["users_module"]), task)
