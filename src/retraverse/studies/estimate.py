"""What a study will take, before it runs: runs, pictures, time and disk.

Times come from describing a few pictures of every drive in exactly the way the study will, so a
technique whose weights or extra are missing shows here too.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from retraverse.studies.keeping.cache import StudyCache
from retraverse.studies.plans.plan import StudyPlan
from retraverse.studies.tasks.describe_task import DescribeTask, describe_task, made_technique
from retraverse.studies.tasks.schedule import COST_S, describe_cost, match_s
from retraverse.studies.tasks.work import Work, plan_work
from retraverse.types import Progress, no_progress

__all__ = ["Estimate", "estimate_study"]

RECORD_BYTES = 1500
START_S = 1.0


@dataclass(frozen=True)
class Estimate:
    """What is left of a study."""

    n_runs: int
    """Runs that the plan asks for."""
    n_kept: int
    """Of these, done already."""
    n_pictures: int
    """Pictures to be described: one at one c by one technique counts once."""
    seconds: float
    """By so many workers; NaN where nothing could be tried."""
    n_bytes: int
    """Disk that cache and records will take in addition."""
    problems: tuple[str, ...]
    """What failed when it was tried, one line each."""


def estimate_study(
    plan: StudyPlan,
    folder: str | Path,
    *,
    workers: int = 1,
    cache: str | Path | None = None,
    progress: Progress = no_progress,
) -> Estimate:
    """Return what is left of a study in a folder, which need not exist and is not written to.

    Parameters are those of `run_study`.

    Raises
    ------
    InputError
        As `run_study` does.
    """
    place = Path(folder)
    work = plan_work(plan, StudyCache(Path(cache) if cache else place / "cache"), None, progress)
    seconds, problems = _try_tasks(work, progress)
    refused = (record.error for record in work.records)
    return Estimate(
        n_runs=work.n_runs,
        n_kept=work.n_kept,
        n_pictures=sum(_n_descriptions(task) for task in work.tasks),
        seconds=START_S + (seconds + _match_s(work)) / max(1, workers),
        n_bytes=_disk(work),
        problems=tuple(dict.fromkeys([*refused, *problems])),
    )


def _try_tasks(work: Work, progress: Progress) -> tuple[float, list[str]]:
    """Return the seconds all describing takes, judged by two pictures of every kind of task."""
    seconds_of: dict[tuple[object, ...], float] = {}
    problems: list[str] = []
    total = 0.0
    for task in progress(work.tasks, total=len(work.tasks), label="trying"):
        if not task.frames:
            total += describe_cost(task) * COST_S
            continue
        # Pictures of one drive take alike; so does all that is wanted of them.
        kind = (task.frames[0].path and task.frames[0].path.parent, _ways(task))
        if kind not in seconds_of:
            seconds_of[kind], failed = _try(task)
            problems.extend(failed)
        total += seconds_of[kind] * len(task.frames)
    return total, problems


def _ways(task: DescribeTask) -> tuple[object, ...]:
    return tuple(
        (wanted.worsening, None if wanted.technique is None else repr(wanted.technique))
        for wanted in task.wanted
    )


def _try(task: DescribeTask) -> tuple[float, list[str]]:
    """Return seconds a picture, and what failed."""
    few = replace(task, frames=task.frames[:2], digests=task.digests[:2])
    first = describe_task(replace(task, frames=task.frames[:1], digests=task.digests[:1]))
    began = time.perf_counter()
    describe_task(few)
    taken = (time.perf_counter() - began) / len(few.frames)
    return taken, list(dict.fromkeys(first.errors.values()))


def _n_descriptions(task: DescribeTask) -> int:
    return len(task.frames) * sum(wanted.technique is not None for wanted in task.wanted)


def _match_s(work: Work) -> float:
    return math.fsum(
        match_s(
            job.technique,
            job.runs,
            (len(job.query.traverse), len(job.reference.traverse)),
            has_matrix=has_matrix,
        )
        for job, has_matrix in zip(work.jobs, work.matrices, strict=True)
    )


def _disk(work: Work) -> int:
    return sum(_parts_of_disk(work))


def _parts_of_disk(work: Work) -> Iterator[int]:
    for task in work.tasks:
        for wanted in task.wanted:
            arrays = (
                {} if wanted.technique is None else made_technique(wanted.technique).layout.arrays
            )
            yield len(task.frames) * (24 + sum(spec.n_bytes for spec in arrays.values()))
    for job, has_matrix in zip(work.jobs, work.matrices, strict=True):
        n_queries, n_references = len(job.query.traverse), len(job.reference.traverse)
        yield 0 if has_matrix else 4 * n_queries * n_references
        yield len(job.runs) * (RECORD_BYTES + 6 * n_queries)
