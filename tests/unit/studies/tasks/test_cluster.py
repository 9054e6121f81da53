"""Tasks on a Dask cluster: by path where its workers see our files, else with all they need."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.unit.studies.tiny import hashes, tiny_plan, tiny_registered, write_dataset

from retraverse.studies.engine import run_study
from retraverse.studies.keeping.cache import CacheEntry
from retraverse.studies.keeping.study_folder import read_study
from retraverse.studies.tasks import cluster
from retraverse.studies.tasks.match_task import (
    InHand,
    Matched,
    MatchTask,
    in_hand,
    is_readable,
    match_task,
)
from retraverse.studies.tasks.workers import Task

distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")


@pytest.fixture(autouse=True)
def _tiny() -> Iterator[None]:
    with tiny_registered():
        yield


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Return the address of a cluster whose workers are threads of this process."""
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address=None,
    ) as started:
        yield started.scheduler_address


class Sent:
    """Remembers the match tasks that workers got."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.tasks: list[MatchTask] = []
        send = cluster.DaskPool._send

        def watched(pool: cluster.DaskPool, number: int, task: Task, attempt: int) -> None:
            if isinstance(task, MatchTask):
                self.tasks.append(task)
            send(pool, number, task, attempt)

        monkeypatch.setattr(cluster.DaskPool, "_send", watched)

    def kinds(self) -> set[type]:
        return {type(source) for task in self.tasks for source in (*task.query, *task.reference)}


@pytest.mark.parametrize("case", ["seen", "unseen", "unseen by one that came later"])
def test_records_are_the_same_however_descriptions_travel(
    case: str, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(tmp_path / "noise", n_frames=40)
    plan = tiny_plan(tmp_path, compression='{ levels = [50, 90], pairs = ["grid"] }')
    sent = Sent(monkeypatch)
    if case == "unseen":
        monkeypatch.setattr(cluster, "_host_that_reads", lambda path, text: "")
    if case == "unseen by one that came later":
        monkeypatch.setattr(cluster, "is_readable", by_hand_only)
    result = run_study(plan, tmp_path / "cluster", cluster=address)
    assert (result.n_ok, result.n_failed) == (12, 0)
    run_study(plan, tmp_path / "here", workers=0)
    assert hashes(read_study(tmp_path / "cluster")) == hashes(read_study(tmp_path / "here"))
    expected = {"seen": {CacheEntry}, "unseen": {InHand}}.get(case, {CacheEntry, InHand})
    assert sent.kinds() == expected
    assert not list((tmp_path / "cluster").rglob(".*.tmp")), "the note is taken away"


def by_hand_only(task: MatchTask) -> bool:
    return all(isinstance(source, InHand) for source in (*task.query, *task.reference))


def test_a_task_in_hand_needs_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_dataset(tmp_path / "noise", n_frames=12)
    seen: list[MatchTask] = []

    def watched(task: MatchTask) -> Matched:
        seen.append(task)
        return match_task(task)

    monkeypatch.setattr("retraverse.studies.tasks.workers.match_task", watched)
    run_study(tiny_plan(tmp_path), tmp_path / "study", workers=0)
    task = seen[0]
    assert is_readable(task)
    carried = in_hand(task)
    for entry in (tmp_path / "study" / "cache").rglob("*.safetensors"):
        entry.unlink()
    assert not is_readable(task)
    assert is_readable(carried)
    assert {record.status for record in match_task(carried).records} == {"ok"}
