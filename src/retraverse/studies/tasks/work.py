"""What a study still has to do: its runs that are not done, and the tasks they wait for.

All files of all datasets are hashed; from the hashes follow the keys of all descriptions and
matrices and the identity of every run. Entries that are in the cache are compared with their
checksums here, so that whoever needs them later can rely on them.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from retraverse._version import __version__
from retraverse.datasets.known import Dataset
from retraverse.errors import InputError, RetraverseError
from retraverse.studies.keeping.cache import StudyCache, content_key
from retraverse.studies.keeping.records import RunRecord
from retraverse.studies.keeping.study_folder import StudyFolder
from retraverse.studies.plans.plan import StudyPlan
from retraverse.studies.tasks.describe_task import DescribeTask, Wanted, one_line_reason
from retraverse.studies.tasks.match_task import failed_runs
from retraverse.studies.tasks.runs import CODE, Chunk, Job, jobs, read_drive
from retraverse.types import Progress, no_progress

__all__ = ["Work", "plan_work", "wanted_entries"]

QUICK_RUNS = 2000
"""So many runs from ready matrices are done faster than workers start."""


@dataclass
class Work:
    """What is left to do."""

    jobs: list[Job] = field(default_factory=list)
    """With the runs that are left."""
    tasks: list[DescribeTask] = field(default_factory=list)
    needs: list[set[int]] = field(default_factory=list)
    """For every job the tasks it waits for."""
    matrices: list[bool] = field(default_factory=list)
    """For every job whether its matrix is in the cache."""
    records: list[RunRecord] = field(default_factory=list)
    """Of runs that cannot be tried."""
    n_runs: int = 0
    n_kept: int = 0

    @property
    def is_quick(self) -> bool:
        """Whether nothing is to be described or compared, and not much to be matched."""
        n_left = sum(len(job.runs) for job in self.jobs)
        return not self.tasks and all(self.matrices) and n_left <= QUICK_RUNS


def plan_work(
    plan: StudyPlan,
    store: StudyCache,
    study: StudyFolder | None = None,
    progress: Progress = no_progress,
) -> Work:
    """Return what a plan leaves to do, given a cache and, if there is one, a study's folder."""
    work = Work(records=[_missing_record(plan, name) for name in plan.missing])
    every_job: list[Job] = []
    for dataset in plan.datasets:
        try:
            query, reference = (
                read_drive(drive, progress) for drive in (dataset.query(), dataset.reference())
            )
        except InputError as error:
            work.records.append(_unreadable_record(plan, dataset, error))
            continue
        every_job.extend(jobs(plan, dataset, query, reference))
    every_job = list(_each_run_once(every_job))
    wanted = {spec.run_id for job in every_job for spec in job.runs}
    done = set() if study is None else study.settle(wanted, plan.name, plan.chapter)
    work.n_runs, work.n_kept = len(wanted) + len(work.records), len(done)
    left = [job.without(done) for job in every_job]
    _Planner(store, work).add([job for job in left if job.runs])
    return work


def _each_run_once(every_job: Iterable[Job]) -> Iterator[Job]:
    """Yield the jobs without runs that came before, as two equal techniques of a plan give."""
    seen: set[str] = set()
    for job in every_job:
        yield job.without(seen)
        seen.update(spec.run_id for spec in job.runs)


class _Planner:
    """Finds the tasks that some jobs need, each entry once."""

    def __init__(self, store: StudyCache, work: Work) -> None:
        self._store = store
        self._work = work
        self._there: dict[str, bool] = {}
        self._maker_of: dict[str, int] = {}
        self._chunks: dict[tuple[str, int], tuple[Chunk, dict[str, Wanted], int]] = {}

    def add(self, left: list[Job]) -> None:
        """Add all jobs to the work."""
        for job in left:
            if job.error is not None:
                self._work.records.extend(_refused(job))
                continue
            has_matrix = self._store.load(job.matrix_key) is not None
            with_descriptions = not has_matrix or job.needs_descriptions
            self._work.jobs.append(job)
            self._work.matrices.append(has_matrix)
            self._work.needs.append(
                {
                    task
                    for wanted, chunk in wanted_entries(job, with_descriptions)
                    if (task := self._task_of(chunk, wanted)) is not None
                }
            )
        self._work.tasks.extend(
            DescribeTask(chunk.label, chunk.frames, chunk.digests, tuple(wanted.values()))
            for chunk, wanted, _ in self._chunks.values()
        )

    def _task_of(self, chunk: Chunk, wanted: Wanted) -> int | None:
        """Return the task that makes an entry, None if it is there already."""
        key = wanted.key
        if key not in self._there:
            self._there[key] = self._store.load(key) is not None
        if self._there[key]:
            return None
        if key not in self._maker_of:
            # The label tells drives apart that have the same contents.
            place = (chunk.content.hex() + chunk.label, 0)
            if place not in self._chunks:
                self._chunks[place] = (chunk, {}, len(self._chunks))
            self._chunks[place][1][key] = wanted
            self._maker_of[key] = self._chunks[place][2]
        return self._maker_of[key]


def wanted_entries(job: Job, with_descriptions: bool) -> Iterator[tuple[Wanted, Chunk]]:
    """Yield every entry a job needs, with the frames it is made of."""
    if job.with_legibility:
        seen = job.pair.query
        yield Wanted(job.legibility_key, seen, None, legibility=True), Chunk(seen.label, (), ())
    for side, (drive, worsening) in enumerate(job.sides):
        entropy = job.needs_entropy and side == 0
        for chunk in drive.chunks:
            key = job.picture_key(chunk, worsening, entropy)
            yield Wanted(key, worsening, None, entropy), chunk
            if with_descriptions:
                key = job.description_key(chunk, worsening)
                yield Wanted(key, worsening, job.technique), chunk


def _refused(job: Job) -> list[RunRecord]:
    """Return the records of a job that cannot be run at all."""
    assert job.error is not None
    status, reason = job.error
    base = job.base(json.dumps({"version": __version__}))
    return list(failed_runs(base, job.runs, reason, status))


def _missing_record(plan: StudyPlan, name: str) -> RunRecord:
    return RunRecord(
        run_id=content_key(CODE, "missing dataset", name),
        study=plan.name,
        dataset=name,
        technique="",
        chapter=plan.chapter,
        status="missing",
        error=f"dataset {name}: not here",
    )


def _unreadable_record(plan: StudyPlan, dataset: Dataset, error: RetraverseError) -> RunRecord:
    return replace(
        _missing_record(plan, dataset.name), status="failed", error=one_line_reason(error)
    )
