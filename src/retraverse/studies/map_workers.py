"""Maps of long drives: described by worker processes or a Dask cluster, kept by one process.

The workers are those of a study. Frames come back in order whoever is first, so that the map is
the one that this process alone would make, but for the last digits of techniques that describe
batches, whose size is measured where they run.
"""

import itertools
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager

from retraverse.errors import InputError
from retraverse.images import Frame
from retraverse.maps.describe import DescribedFrame, Describer, Frames, count_frames
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.studies.plans.plan import CHUNK_FRAMES
from retraverse.studies.tasks.frames_task import DescribedFrames, FramesTask, choice_of
from retraverse.studies.tasks.workers import Pool, ProcessPool, lost_task
from retraverse.techniques import Technique
from retraverse.types import Progress, no_progress

__all__ = ["PoolDescriber", "describing_by"]


class PoolDescriber:
    """Describes the frames of a map by a pool of workers; see `maps.describe.Describer`.

    Parameters
    ----------
    pool : Pool
        Of nobody else's tasks.
    """

    def __init__(self, pool: Pool) -> None:
        self._pool = pool

    def __call__(
        self,
        frames: Frames,
        technique: Technique,
        *,
        thumbnails: ThumbnailSpec | None = None,
        progress: Progress = no_progress,
    ) -> Generator[DescribedFrame, None, None]:
        """Yield every frame described, in order; parameters as in `describe_frames`."""
        n_frames, choice = count_frames(frames), choice_of(technique)
        tasks = (FramesTask(chunk, choice, thumbnails) for chunk in _chunks(frames))
        each = itertools.chain.from_iterable(self._in_order(tasks))
        yield from progress(each, total=n_frames, label=f"describing with {technique.name}")

    def _in_order(self, tasks: Iterator[FramesTask]) -> Iterator[tuple[DescribedFrame, ...]]:
        """Yield what comes of each task; no more are begun than a few ahead of it."""
        running: dict[int, FramesTask] = {}
        finished: dict[int, DescribedFrames] = {}
        n_begun = 0
        for number in itertools.count():
            while number not in finished:
                ahead = max(1, self._pool.capacity) - (n_begun - number)
                for task in itertools.islice(tasks, max(0, ahead)):
                    running[n_begun] = task
                    self._pool.submit(n_begun, task)
                    n_begun += 1
                if not running:
                    return
                done = self._pool.next_done()
                begun = running.pop(done.number)
                outcome = lost_task(begun) if done.outcome is None else done.outcome
                assert isinstance(outcome, DescribedFrames)
                finished[done.number] = outcome
            described = finished.pop(number)
            if described.error is not None:
                raise described.error
            yield described.frames


@contextmanager
def describing_by(
    workers: int | None = None, cluster: str | None = None
) -> Iterator[Describer | None]:
    """Give who describes the frames of a map, and end the workers afterwards.

    Parameters
    ----------
    workers : int >= 1, optional
        Processes of this machine.
    cluster : str, optional
        A Dask cluster in place of them, as for `run_study`.

    Yields
    ------
    Describer or None
        None without either: threads of this process will do.

    Raises
    ------
    InputError
        If both are given, or the cluster does not answer.
    MissingExtraError
        If `cluster` needs Dask and it is not there.
    """
    if workers is not None and cluster is not None:
        raise InputError("got workers and a cluster, expected one of them")
    pool = _pool(workers, cluster)
    try:
        yield None if pool is None else PoolDescriber(pool)
    finally:
        if pool is not None:
            pool.close()


def _pool(workers: int | None, cluster: str | None) -> Pool | None:
    if cluster is not None:
        from retraverse.studies.tasks.cluster import DaskPool

        return DaskPool(cluster)
    if workers is None:
        return None
    if workers < 1:
        raise InputError(f"workers: got {workers}, expected 1 or more")
    return ProcessPool(workers)


def _chunks(frames: Iterable[Frame]) -> Iterator[tuple[Frame, ...]]:
    source = iter(frames)
    while chunk := tuple(itertools.islice(source, CHUNK_FRAMES)):
        yield chunk
