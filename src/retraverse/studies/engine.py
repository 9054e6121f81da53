"""Running a study: what is done is kept, what is missing is made once, the rest goes on.

For every dataset all files are hashed; from the hashes follow the keys of all descriptions and
matrices and the identity of every run. What is in the cache is taken from there; the rest becomes
tasks: first pieces of drives are described, in every way several runs need them, then each pair of
drives is matched by all matchers and lengths. One process plans, hands out and writes; workers of
this machine or of a cluster compute.

A run is done when its record is on disk, which is at most `FLUSH_S` after it was computed. A
killed study starts again with what was not done.
"""

import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from retraverse.errors import InputError
from retraverse.maps.describe import available_cores
from retraverse.studies.keeping.cache import StudyCache
from retraverse.studies.keeping.records import RunRecord
from retraverse.studies.keeping.study_folder import StudyFolder
from retraverse.studies.plans.plan import StudyPlan
from retraverse.studies.plans.plan_checks import PlanError, plan_problems
from retraverse.studies.tasks.describe_task import Described
from retraverse.studies.tasks.empty_roi import EmptyRoiCount
from retraverse.studies.tasks.match_task import InHand, Matched, MatchTask, Source, failed_runs
from retraverse.studies.tasks.run_provenance import RunProvenance
from retraverse.studies.tasks.runs import Job
from retraverse.studies.tasks.schedule import Schedule
from retraverse.studies.tasks.work import Work, plan_work, wanted_entries
from retraverse.studies.tasks.workers import InlinePool, Pool, ProcessPool, Task, lost_task
from retraverse.types import Array, Progress, no_progress

__all__ = ["StudyResult", "run_study"]

FLUSH_S = 0.25
"""Records wait at most so long for others, to go into one file."""
FLUSH_RECORDS = 200


@dataclass(frozen=True)
class StudyResult:
    """What running a study came to."""

    folder: Path
    n_runs: int
    """Runs that the plan asks for."""
    n_kept: int
    """Of these, done before."""
    n_ok: int
    """Done now."""
    n_failed: int
    """Tried now, with an error; they are tried again the next time."""
    n_missing: int
    """Not tried: data or weights are not here."""
    n_described: int
    """Pictures described now; one picture at one c by one technique counts once."""
    n_damaged: int
    """Cache entries that were damaged and made anew."""
    seconds: float


def run_study(
    plan: StudyPlan,
    folder: str | Path,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    cache: str | Path | None = None,
    progress: Progress = no_progress,
) -> StudyResult:
    """Run all of a plan that is not done yet, and keep one record for every run.

    Parameters
    ----------
    plan : StudyPlan
    folder : path
        The study's folder; made where it does not exist.
    workers : int >= 0, optional
        Processes of this machine; default: the cores this process may use. 0 = none: all is done
        in this process, as debuggers like it.
    cluster : str, optional
        A Dask cluster in place of them: ``tcp://…``, ``tls://…`` or ``local:4``.
    cache : path, optional
        Where descriptors and matrices are kept; default: in the study's folder. Several studies
        may share one, also at once.
    progress : Progress
        Shows how far it has come.

    Raises
    ------
    PlanError
        If the plan cannot be run as it is.
    InputError
        If the folder or cache cannot be written to (disk full), the study is being run by another
        process, or the cluster does not answer. What is done stays done.
    MissingExtraError
        If `cluster` needs Dask and it is not there.

    Notes
    -----
    A run that fails is a record with status "failed" and its error; the others go on. Records are
    the same, but for times and dates, whoever computes them: see `RunRecord.content_hash`.
    """
    began = time.monotonic()
    if workers is not None and workers < 0:
        raise InputError(f"workers: got {workers}, expected 0 or more")
    problems = plan_problems(plan)
    if problems:
        raise PlanError(plan.name, problems)
    with StudyFolder.opened(Path(folder)) as study:
        study.write_plan(plan)
        # Absolute: workers of a cluster may run in another folder.
        store = StudyCache((Path(cache) if cache is not None else study.cache).absolute())
        work = plan_work(plan, store, study, progress)
        run = _Run(study, store, work)
        run.do(plan, available_cores() if workers is None else workers, cluster, progress)
        return StudyResult(
            folder=study.path,
            n_runs=work.n_runs,
            n_kept=work.n_kept,
            n_ok=run.n_of["ok"],
            n_failed=run.n_of["failed"],
            n_missing=run.n_of["missing"],
            n_described=run.n_described,
            n_damaged=len(store.damaged),
            seconds=time.monotonic() - began,
        )


class _Run:
    """A study at work."""

    def __init__(self, study: StudyFolder, store: StudyCache, work: Work) -> None:
        self.n_of = {"ok": 0, "failed": 0, "missing": 0}
        self.n_described = 0
        self._study = study
        self._store = store
        self._work = work
        self._errors: dict[str, str] = {}
        self._schedule = Schedule(work)
        self._provenance = RunProvenance()
        self._empty_roi = EmptyRoiCount()
        self._pictures: dict[tuple[int, str, bool], _Pictures] = {}
        self._flushed = time.monotonic()

    def do(self, plan: StudyPlan, workers: int, cluster: str | None, progress: Progress) -> None:
        """Do all the work."""
        self._keep(self._work.records)
        if self._work.jobs:
            pool = _pool(plan, self._work, workers, cluster, self._store.folder)
            try:
                self._do_tasks(pool, plan.name, progress)
            finally:
                pool.close()
                self._empty_roi.say()
        self._study.flush()

    def _do_tasks(self, pool: Pool, name: str, progress: Progress) -> None:
        n_jobs, total = len(self._work.jobs), self._schedule.total
        steps = itertools.chain.from_iterable(map(range, self._costs_done(pool)))
        for _ in progress(steps, total=total, label=f"study {name}: {n_jobs} pairs of drives"):
            pass

    def _costs_done(self, pool: Pool) -> Iterator[int]:
        """Run all tasks; yield the cost of each as it is done."""
        schedule = self._schedule
        running: dict[int, Task] = {}
        while schedule or running:
            while schedule and len(running) < pool.capacity:
                number = schedule.next()
                task = self._task(number, pool.sees_files)
                if task is None:
                    yield schedule.cost(number)
                else:
                    running[number] = task
                    pool.submit(number, task)
            if running:
                done = pool.next_done()
                begun = running.pop(done.number)
                outcome = lost_task(begun) if done.outcome is None else done.outcome
                if isinstance(outcome, Described):
                    self._take_described(done.number, outcome)
                elif isinstance(outcome, Matched):
                    self._take_matched(-1 - done.number, outcome)
                yield schedule.cost(done.number)

    def _task(self, number: int, by_path: bool) -> Task | None:
        """Return a task by its number; None for a job whose records are written already."""
        return self._work.tasks[number] if number >= 0 else self._match_task(-1 - number, by_path)

    def _take_described(self, number: int, outcome: Described) -> None:
        """Keep what was described."""
        for key, arrays in outcome.entries.items():
            self._store.save(key, arrays)
        self._errors.update(outcome.errors)
        task = self._work.tasks[number]
        self.n_described += len(task.frames) * sum(
            wanted.technique is not None and wanted.key in outcome.entries for wanted in task.wanted
        )
        self._schedule.described(number)

    def _take_matched(self, number: int, outcome: Matched) -> None:
        if outcome.matrix is not None:
            job = self._work.jobs[number]
            self._store.save(job.matrix_key, outcome.matrix)
            self._empty_roi.add(job.technique, outcome.n_empty_roi, len(job.query.traverse))
        self._keep(outcome.records)

    def _keep(self, records: Iterable[RunRecord]) -> None:
        listed = list(records)
        for record in listed:
            self.n_of[record.status] += 1
        self._study.add(listed)
        now = time.monotonic()
        if now - self._flushed > FLUSH_S or self._study.n_waiting >= FLUSH_RECORDS:
            self._study.flush()
            self._flushed = now

    def _match_task(self, number: int, by_path: bool) -> MatchTask | None:
        """Return a job as a task; None if what it needs failed, which is then on record."""
        job, has_matrix = self._work.jobs[number], self._work.matrices[number]
        with_descriptions = not has_matrix or job.needs_descriptions
        failed = [
            self._errors[wanted.key]
            for wanted, _ in wanted_entries(job, with_descriptions)
            if wanted.key in self._errors
        ]
        if failed:
            self._keep(failed_runs(job.base(self._provenance.of(job)), job.runs, failed[0]))
            return None
        query, reference = (self._side(job, side) for side in range(2))
        base = replace(
            job.base(self._provenance.of(job)),
            query_bytes_mean=query.bytes_mean,
            reference_bytes_mean=reference.bytes_mean,
            query_bytes_total=query.bytes_total,
            reference_bytes_total=reference.bytes_total,
            compress_s=query.compress_s,
            query_bare_bytes_mean=query.bare_bytes_mean,
            entropy_query_mean=query.entropy_mean if job.with_entropy else math.nan,
            legible_height=self._legible_height(job) if job.with_legibility else math.nan,
        )
        sources = [
            tuple(
                self._source(job.description_key(chunk, worsening), by_path)
                for chunk in drive.chunks
            )
            if with_descriptions
            else ()
            for drive, worsening in job.sides
        ]
        return MatchTask(
            base=base,
            technique=job.technique,
            runs=job.runs,
            truth=job.dataset.truth(),
            matrix=self._source(job.matrix_key, by_path) if has_matrix else None,
            sent=job.sent,
            query=sources[0],
            reference=sources[1],
            query_entropy=query.entropy if job.needs_entropy else (),
        )

    def _source(self, key: str, by_path: bool) -> Source:
        entry = self._store.entry(key)
        return entry if by_path else InHand(entry.load())

    def _legible_height(self, job: Job) -> float:
        return float(self._store.entry(job.legibility_key).load()["height"][0])

    def _side(self, job: Job, side: int) -> "_Pictures":
        """Return the sizes and times of one drive's pictures; read once for all jobs."""
        drive, worsening = job.sides[side]
        entropy = job.needs_entropy and side == 0
        keys = [job.picture_key(chunk, worsening, entropy) for chunk in drive.chunks]
        place = (id(drive), keys[0], entropy)
        if place not in self._pictures:
            self._pictures[place] = _Pictures.of([self._store.entry(key).load() for key in keys])
        return self._pictures[place]


@dataclass(frozen=True)
class _Pictures:
    """Sizes, t_c and entropy of a drive's pictures."""

    bytes_mean: float
    bytes_total: int
    bare_bytes_mean: float
    compress_s: float
    entropy_mean: float
    entropy: tuple[float, ...]

    @classmethod
    def of(cls, pieces: list[dict[str, Array]]) -> "_Pictures":
        n_bytes, n_bare, compress_s, entropy = (
            np.concatenate([piece[name] for piece in pieces])
            for name in ("n_bytes", "n_bare_bytes", "compress_s", "entropy")
        )
        return cls(
            bytes_mean=float(n_bytes.mean()),
            bytes_total=int(n_bytes.sum()),
            bare_bytes_mean=float(n_bare.mean()) if n_bare.min() >= 0 else math.nan,
            compress_s=float(np.median(compress_s)),
            entropy_mean=float(entropy.mean()),
            entropy=tuple(entropy.tolist()),
        )


def _pool(plan: StudyPlan, work: Work, workers: int, cluster: str | None, cache: Path) -> Pool:
    if cluster is not None:
        from retraverse.studies.tasks.cluster import DaskPool

        return DaskPool(cluster, plan.modules, cache)
    if work.is_quick or workers == 0:
        return InlinePool()
    n_tasks = len(work.tasks) + len(work.jobs)
    return ProcessPool(min(workers, n_tasks), plan.modules)
