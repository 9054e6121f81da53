"""The order of a study's tasks: longest first, and nothing before what it waits for."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.unit.studies.tiny import tiny_plan, tiny_registered, write_dataset

from retraverse.studies.keeping.cache import StudyCache
from retraverse.studies.plans.plan import MatcherChoice, TechniqueChoice
from retraverse.studies.tasks.match_task import RunSpec
from retraverse.studies.tasks.schedule import Schedule, describe_cost, match_s
from retraverse.studies.tasks.work import Work, plan_work

CONV = TechniqueChoice("convsequential", {"resolution": 96})
EACH = TechniqueChoice("convsequential", {"resolution": 96, "roi": "each"})
HOG = TechniqueChoice("hog")


@pytest.fixture(autouse=True)
def _tiny() -> Iterator[None]:
    with tiny_registered():
        yield


@pytest.fixture
def work(tmp_path: Path) -> Work:
    """Return two datasets, the second one much longer, each by two techniques."""
    write_dataset(tmp_path / "short", n_frames=8)
    write_dataset(tmp_path / "long", n_frames=70, seed=1)
    conv = '{ name = "convsequential", parameters = { resolution = 512 } }'
    plan = tiny_plan(
        tmp_path,
        datasets='["short", "long"]',
        techniques=f'["tiny", {conv}]',
        compression='{ levels = ["none"] }',
    )
    return plan_work(plan, StudyCache(tmp_path / "cache"))


def test_every_task_once_and_none_too_early(work: Work) -> None:
    schedule, begun, described = Schedule(work), list[int](), set[int]()
    total = schedule.total
    while schedule:
        number = schedule.next()
        begun.append(number)
        if number < 0:
            assert work.needs[-1 - number] <= described
        else:
            described.add(number)
            schedule.described(number)
    assert sorted(begun) == list(range(-len(work.jobs), len(work.tasks)))
    assert total == sum(map(schedule.cost, begun))


def test_long_drives_first_and_the_longest_match_of_them(work: Work) -> None:
    schedule, begun = Schedule(work), list[int]()
    while schedule:
        begun.append(schedule.next())
        if begun[-1] >= 0:
            schedule.described(begun[-1])
    frames = [len(work.tasks[number].frames) for number in begun if number >= 0]
    assert frames == [32, 32, 32, 32, 6, 6, 8, 8]
    matched = [work.jobs[-1 - number] for number in begun if number < 0]
    names = [(job.dataset.name, job.technique.name) for job in matched]
    assert names == [
        (dataset, technique)
        for dataset in ("long", "short")
        for technique in ("convsequential", "tiny")
    ]


def test_tasks_that_wait_hold_up_no_others(work: Work) -> None:
    schedule = Schedule(work)
    begun = [schedule.next() for _ in work.tasks]
    assert all(number >= 0 for number in begun)
    assert not schedule
    for number in begun:
        schedule.described(number)
    costs = [schedule.cost(schedule.next()) for _ in work.jobs]
    assert costs == sorted(costs, reverse=True)


def runs(*lengths: int | str, matcher: str = "mean") -> tuple[RunSpec, ...]:
    return tuple(RunSpec("", MatcherChoice(matcher), length, 0) for length in lengths)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("less", "more"),
    [
        # A ready matrix, the regions of single frames, those of a window's first frame.
        ((EACH, runs(5), True), (EACH, runs(5), False)),
        ((EACH, runs(5), False), (CONV, runs(5), False)),
        ((CONV, runs(1), True), (CONV, runs(2), True)),
        ((HOG, runs(5), False), (CONV, runs(5), False)),
        ((HOG, runs(5), True), (HOG, runs(5, matcher="seqslam"), True)),
        ((HOG, runs(5), True), (HOG, runs(5, 6), True)),
    ],
)
def test_what_takes_longer_costs_more(
    less: tuple[TechniqueChoice, tuple[RunSpec, ...], bool],
    more: tuple[TechniqueChoice, tuple[RunSpec, ...], bool],
) -> None:
    for shape in ((50, 50), (400, 300)):
        low, high = (
            match_s(technique, specs, shape, has_matrix=has_matrix)
            for technique, specs, has_matrix in (less, more)
        )
        assert 0 < low < high


def test_many_lengths_by_one_pass_cost_little_more_than_one() -> None:
    one, many = (match_s(CONV, runs(*n), (400, 300), has_matrix=True) for n in ([2], range(1, 21)))
    assert one < many < 2 * one


def test_describing_costs_grow_with_frames_and_techniques(work: Work) -> None:
    assert [describe_cost(task) for task in work.tasks[:2]] == [3 * 8, 3 * 8]
    assert max(map(describe_cost, work.tasks)) == 3 * 32
