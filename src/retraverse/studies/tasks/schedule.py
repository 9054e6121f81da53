"""In which order a study's tasks are begun: the longest first, so that no worker ends alone.

A pair of drives is matched as soon as both are described, before more is described: so records
come early. Among the pairs that are ready the one that takes longest goes first. What is described
first are the drives of which most work hangs, so that the last tasks of a study are short ones.

Times are estimated from sizes: they need to be right in proportion only. Their unit is
`COST_S`, about the time one picture takes to be described by a handcrafted technique.
"""

import heapq
from collections import deque

from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.studies.tasks.describe_task import DescribeTask, Wanted, made_technique
from retraverse.studies.tasks.match_task import RunSpec, needs_descriptions
from retraverse.studies.tasks.runs import Job
from retraverse.studies.tasks.work import Work

__all__ = ["COST_S", "Schedule", "describe_cost", "match_s"]

COST_S = 0.01
"""Seconds of one unit of cost."""
NETWORK_COST = 20
"""A network takes so many times as long for a picture as a handcrafted technique."""
LEGIBILITY_COST = 500
"""Finding out what can be read, without any frames."""
OPERATIONS_S = 4e10
"""Multiplications of a similarity matrix a second, on one thread."""
RUN_S = 0.003
"""Matching by the mean and judging one short run, and writing its record."""
CELL_S = 1e-7
"""What other matchers take for each number of the matrix."""


def describe_cost(task: DescribeTask) -> int:
    """Return about how long describing some frames takes, in units of `COST_S`."""
    if not task.frames:
        return LEGIBILITY_COST * len(task.wanted)
    return len(task.frames) * sum(map(_picture_cost, task.wanted))


def match_s(
    technique: TechniqueChoice,
    runs: tuple[RunSpec, ...],
    shape: tuple[int, int],
    *,
    has_matrix: bool,
) -> float:
    """Return about how many seconds matching one pair of drives takes.

    Parameters
    ----------
    technique : TechniqueChoice
    runs : tuple of RunSpec
    shape : (int, int)
        Frames of the query and of the map.
    has_matrix : bool
        Whether the similarity matrix is there already.
    """
    layout = made_technique(technique).layout
    n_cells, n_multiplied = shape[0] * shape[1], layout.dimension
    n_passes = int(not has_matrix)
    if layout.kind == "regional":
        # Every region of one picture with every region of the other; and once more for all
        # windows under the region of interest of their first frame.
        n_multiplied *= layout.descriptor.shape[0]
        n_passes += needs_descriptions(technique, runs)
    per_run = [RUN_S + (spec.matcher.name != "mean") * n_cells * CELL_S for spec in runs]
    return n_passes * n_cells * n_multiplied / OPERATIONS_S + sum(per_run)


class Schedule:
    """The tasks of a study that are to be begun, longest first.

    Describing tasks are numbered from 0 as in `Work.tasks`; job j is number -1 - j.

    Parameters
    ----------
    work : Work
    """

    def __init__(self, work: Work) -> None:
        self._describe_costs = [describe_cost(task) for task in work.tasks]
        self._match_costs = [
            _match_cost(job, has_matrix)
            for job, has_matrix in zip(work.jobs, work.matrices, strict=True)
        ]
        self._waiting_for = [set(needs) for needs in work.needs]
        self._jobs_of: dict[int, list[int]] = {number: [] for number in range(len(work.tasks))}
        for job, needs in enumerate(work.needs):
            for number in needs:
                self._jobs_of[number].append(job)
        self._describing = self._most_work_first()
        self._matching: list[tuple[int, int]] = []
        self._add_ready(range(len(work.jobs)))

    @property
    def total(self) -> int:
        """Cost of all tasks."""
        return sum(self._describe_costs) + sum(self._match_costs)

    def __bool__(self) -> bool:
        """Whether a task can be begun."""
        return bool(self._matching or self._describing)

    def cost(self, number: int) -> int:
        """Return the cost of a task."""
        return self._describe_costs[number] if number >= 0 else self._match_costs[-1 - number]

    def next(self) -> int:
        """Return the number of the task to begin now."""
        if self._matching:
            return -1 - heapq.heappop(self._matching)[1]
        return self._describing.popleft()

    def described(self, number: int) -> None:
        """Say that a describing task is done: pairs of drives may be ready now."""
        jobs = self._jobs_of[number]
        for job in jobs:
            self._waiting_for[job].discard(number)
        self._add_ready(jobs)

    def _add_ready(self, jobs: list[int] | range) -> None:
        for job in jobs:
            if not self._waiting_for[job]:
                heapq.heappush(self._matching, (-self._match_costs[job], job))

    def _most_work_first(self) -> deque[int]:
        """Return the describing tasks: drives of most work first, those of one pair together."""
        work = [
            cost + sum(self._describe_costs[number] for number in needs)
            for cost, needs in zip(self._match_costs, self._waiting_for, strict=True)
        ]

        def urgency(number: int) -> tuple[int, int, int]:
            jobs = self._jobs_of[number]
            most = max((work[job] for job in jobs), default=0)
            return -most, min(jobs, default=0), -self._describe_costs[number]

        return deque(sorted(self._jobs_of, key=urgency))


def _match_cost(job: Job, has_matrix: bool) -> int:
    shape = len(job.query.traverse), len(job.reference.traverse)
    return 1 + round(match_s(job.technique, job.runs, shape, has_matrix=has_matrix) / COST_S)


def _picture_cost(wanted: Wanted) -> int:
    if wanted.technique is None:
        return 1
    try:
        made = made_technique(wanted.technique)
    except Exception:  # What is wrong with it is said where it is used.
        return 1
    return NETWORK_COST if hasattr(made, "fingerprint") else 1
