"""Who runs the tasks of a study or a map: this process, or worker processes of this machine.

A task is a plain value and its outcome is one too, whoever runs it; workers read pictures and
write nothing. Each computes on one thread. A worker that dies (out of memory, killed) costs its
task's time: another takes its place and the task is run again, up to `MOST_ATTEMPTS` times. When
this process is killed its workers end too, in the middle of what they are at. A worker lost while
it starts is started anew as often.
"""

import logging
import os
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Protocol

from retraverse.errors import RetraverseError
from retraverse.studies.tasks.describe_task import Described, DescribeTask, describe_task
from retraverse.studies.tasks.frames_task import DescribedFrames, FramesTask, frames_task
from retraverse.studies.tasks.match_task import Matched, MatchTask, failed_runs, match_task

__all__ = [
    "MOST_ATTEMPTS",
    "ONE_THREAD",
    "Done",
    "InlinePool",
    "Outcome",
    "Pool",
    "ProcessPool",
    "Task",
    "lost_task",
    "run_task",
]

logger = logging.getLogger(__name__)

Task = DescribeTask | MatchTask | FramesTask
Outcome = Described | Matched | DescribedFrames
MOST_ATTEMPTS = 3
"""A task, or a start, whose worker was lost so often is given up: it is likely to be the reason."""
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RETRAVERSE_THREADS"), "1"
)
"""Environment of a worker: libraries compute on one thread, so that results do not differ."""


@dataclass(frozen=True)
class Done:
    """A task that came back."""

    number: int
    outcome: Outcome | None
    """None if its worker was lost every time."""


class Pool(Protocol):
    """Runs tasks, several at once, in any order."""

    sees_files: bool
    """Whether its workers can read the study's cache."""

    @property
    def capacity(self) -> int:
        """How many tasks it should hold: what runs, and a little more."""
        ...

    def submit(self, number: int, task: Task) -> None:
        """Take a task on."""
        ...

    def next_done(self) -> Done:
        """Return the next task that comes back; waits for it."""
        ...

    def close(self) -> None:
        """Stop all workers; what still runs is given up."""
        ...


def run_task(task: Task) -> Outcome:
    """Return the outcome of a task."""
    if isinstance(task, DescribeTask):
        return describe_task(task)
    return match_task(task) if isinstance(task, MatchTask) else frames_task(task)


def lost_task(task: Task) -> Outcome:
    """Return the outcome of a task that loses its worker every time."""
    reason = f"its worker was lost {MOST_ATTEMPTS} times (out of memory, or crashed?)"
    if isinstance(task, DescribeTask):
        return Described({}, {wanted.key: reason for wanted in task.wanted})
    if isinstance(task, FramesTask):
        return DescribedFrames(error=RetraverseError(f"{task.label}: {reason}"))
    return Matched(failed_runs(task.base, task.runs, reason), None)


class InlinePool:
    """Runs tasks in this process, when asked for the outcome: for what is quick."""

    sees_files = True
    capacity = 1

    def __init__(self) -> None:
        self._tasks: deque[tuple[int, Task]] = deque()

    def submit(self, number: int, task: Task) -> None:
        """See `Pool.submit`."""
        self._tasks.append((number, task))

    def next_done(self) -> Done:
        """See `Pool.next_done`."""
        number, task = self._tasks.popleft()
        return Done(number, run_task(task))

    def close(self) -> None:
        """See `Pool.close`."""


@dataclass
class _Worker:
    process: subprocess.Popen[bytes]
    link: Connection
    number: int | None = None
    """The task it is at."""
    is_ready: bool = False
    """Whether it has started up."""
    attempt: int = 1
    """Counts the workers started one after another in this place, none of which got ready."""


class ProcessPool:
    """Worker processes of this machine.

    Parameters
    ----------
    n_workers : int >= 1
    modules : sequence of str
        Python modules every worker imports first.
    """

    sees_files = True

    def __init__(self, n_workers: int, modules: Sequence[str] = ()) -> None:
        self._modules = tuple(modules)
        self._queue: deque[int] = deque()
        self._tasks: dict[int, Task] = {}
        self._attempts: dict[int, int] = {}
        self._given_up: deque[int] = deque()
        self._workers = [self._start() for _ in range(n_workers)]

    @property
    def capacity(self) -> int:
        """See `Pool.capacity`: one waits for every one that runs."""
        return 2 * len(self._workers)

    @property
    def process_ids(self) -> list[int]:
        """Of the workers that live now."""
        return [worker.process.pid for worker in self._workers]

    def submit(self, number: int, task: Task) -> None:
        """See `Pool.submit`."""
        self._tasks[number] = task
        self._queue.append(number)
        self._hand_out()

    def next_done(self) -> Done:
        """See `Pool.next_done`."""
        while True:
            self._hand_out()
            if self._given_up:
                return Done(self._given_up.popleft(), None)
            links = {worker.link: worker for worker in self._workers}
            for link in wait(list(links)):
                done = self._hear(links[link])  # type: ignore[index]
                if done is not None:
                    return done

    def close(self) -> None:
        """See `Pool.close`."""
        for worker in self._workers:
            worker.link.close()
            worker.process.terminate()
        for worker in self._workers:
            worker.process.wait()
        self._workers = []

    def _start(self, attempt: int = 1) -> _Worker:
        ours, theirs = Pipe()
        with theirs:
            numbers = map(str, (theirs.fileno(), os.getpid()))
            process = subprocess.Popen(
                [sys.executable, "-m", "retraverse.studies.tasks.worker", *numbers],
                pass_fds=[theirs.fileno()],
                env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(_search_path())},
                stdin=subprocess.DEVNULL,
                stdout=2,  # What a technique prints must not get among our results.
            )
        worker = _Worker(process, ours, attempt=attempt)
        ours.send(self._modules)
        return worker

    def _hand_out(self) -> None:
        for index, worker in enumerate(self._workers):
            if not self._queue:
                return
            if worker.number is None and worker.is_ready:
                worker.number = self._queue.popleft()
                try:
                    worker.link.send(self._tasks[worker.number])
                except OSError:
                    self._replace(index)

    def _hear(self, worker: _Worker) -> Done | None:
        """Take what a worker says: that it is ready, an outcome, or its end."""
        try:
            said = worker.link.recv()
        except (EOFError, OSError):
            self._replace(self._workers.index(worker))
            return None
        if not worker.is_ready:
            if said != "ready":
                raise RetraverseError(f"a worker cannot start: {said}")
            worker.is_ready = True
            return None
        number, worker.number = worker.number, None
        assert number is not None
        self._forget(number)
        self._hand_out()
        return Done(number, said)

    def _replace(self, index: int) -> None:
        """Put a new worker in the place of a lost one; its task is run again, or given up."""
        lost = self._workers[index]
        lost.link.close()
        code = lost.process.wait()
        if not lost.is_ready and lost.attempt >= MOST_ATTEMPTS:
            raise RetraverseError(
                f"a worker was lost {lost.attempt} times before it was ready "
                f"(exit code {code}; out of memory, or crashed?)"
            )
        self._workers[index] = self._start(1 if lost.is_ready else lost.attempt + 1)
        number = lost.number
        if number is None:
            return
        self._attempts[number] = self._attempts.get(number, 0) + 1
        if self._attempts[number] >= MOST_ATTEMPTS:
            self._forget(number)
            self._given_up.append(number)
            return
        logger.warning("a worker was lost (exit code %d); its task is run again", code)
        self._queue.appendleft(number)

    def _forget(self, number: int) -> None:
        self._tasks.pop(number, None)
        self._attempts.pop(number, None)


def _search_path() -> list[str]:
    """Return where this process finds modules, so that a worker finds the same ones."""
    return [str(Path(entry).resolve()) for entry in sys.path]
