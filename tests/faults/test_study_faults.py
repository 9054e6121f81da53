"""Studies under damage: what is done stays done, what is wrong is said, nothing stale returns."""

import errno
import logging
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.faults.study_process import PLAN
from tests.unit.studies.tiny import (
    DEATH_NOTE,
    HANG_S,
    ROOT,
    hashes,
    tiny_plan,
    tiny_registered,
    wait_for,
    write_dataset,
)

from retraverse.errors import InputError
from retraverse.studies.engine import run_study
from retraverse.studies.keeping import cache as cache_module
from retraverse.studies.keeping.cache import StudyCache
from retraverse.studies.keeping.study_folder import read_study
from retraverse.studies.tasks import workers
from retraverse.studies.tasks.work import plan_work


@pytest.fixture(autouse=True)
def _tiny() -> Iterator[None]:
    with tiny_registered():
        yield


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_dataset(tmp_path / "data" / "noise", n_frames=40)
    return tmp_path / "data"


def left_overs(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob("*.tmp")]


def test_kill_at_any_instant_then_resume(
    data: Path, tmp_path: Path, scaled: Callable[[int], int]
) -> None:
    whole = run_study(tiny_plan(data, **PLAN), tmp_path / "whole", workers=0)
    expected = hashes(read_study(tmp_path / "whole"))
    assert len(expected) == whole.n_ok == 36
    seed = int(os.environ.get("RETRAVERSE_SEED", str(random.randrange(10**6))))
    print("seed", seed)
    rng = random.Random(seed)
    n_resumed, n_attempts = 0, max(2, scaled(20))
    for attempt in range(n_attempts):
        study = tmp_path / f"study {attempt}"
        # Every second one is killed when it has something to go on from.
        is_begun = attempt % 2 == 1
        life_s = rng.uniform(0.0, (0.2 if is_begun else 1.5) * whole.seconds)
        start_and_kill(data, study, life_s, is_begun=is_begun)
        result = run_study(tiny_plan(data, **PLAN), study, workers=0)
        assert result.n_kept + result.n_ok == 36
        n_resumed += result.n_kept
        assert hashes(read_study(study)) == expected
        assert left_overs(study) == []
    assert n_resumed, "no kill found a record on disk: this would test nothing"


def start_and_kill(data: Path, study: Path, life_s: float, *, is_begun: bool) -> None:
    """Run a study in another process and kill -9 it `life_s` after it began, or had a record."""
    process = start(data, study)
    assert process.stdout
    assert process.stdout.readline() == "go\n"
    if is_begun:
        wait_for(lambda: any((study / "records").glob("*.parquet")), seconds=60)
    time.sleep(life_s)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()


def start(*arguments: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.faults.study_process", *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_two_studies_share_a_cache_at_once(data: Path, tmp_path: Path) -> None:
    both = [start(data, tmp_path / name, tmp_path / "cache") for name in ("one", "two")]
    said = [process.communicate(timeout=120)[0] for process in both]
    assert said == ["go\n36 0\n"] * 2
    one, two = (hashes(read_study(tmp_path / name)) for name in ("one", "two"))
    assert one == two
    assert left_overs(tmp_path) == []


@pytest.mark.parametrize("damage", ["cut", "bit", "empty", "header"])
def test_a_damaged_entry_is_made_anew_and_said(
    data: Path, tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    run_study(tiny_plan(data), tmp_path / "one", workers=0, cache=tmp_path / "cache")
    entries = sorted((tmp_path / "cache").rglob("*.safetensors"))
    for entry in entries:
        content = bytearray(entry.read_bytes())
        if damage == "bit":
            content[-1] ^= 16
        if damage == "header":
            content[20] ^= 1
        n_kept = {"cut": len(content) - 1, "empty": 0}.get(damage, len(content))
        entry.write_bytes(content[:n_kept])
    with caplog.at_level(logging.WARNING):
        result = run_study(tiny_plan(data), tmp_path / "two", workers=0, cache=tmp_path / "cache")
    assert result.n_damaged == len(entries)
    assert result.n_described == 160
    assert "is damaged" in caplog.text
    assert "made anew" in caplog.text
    assert hashes(read_study(tmp_path / "one")) == hashes(read_study(tmp_path / "two"))


def test_a_damaged_record_file_is_put_away_and_its_runs_are_done_again(
    data: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    run_study(tiny_plan(data), tmp_path / "study", workers=0)
    before = hashes(read_study(tmp_path / "study"))
    for file in (tmp_path / "study" / "records").iterdir():
        file.write_bytes(file.read_bytes()[:-9])
    with caplog.at_level(logging.WARNING):
        result = run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert (result.n_kept, result.n_ok, result.n_described) == (0, 12, 0)
    assert "its runs are done again" in caplog.text
    assert hashes(read_study(tmp_path / "study")) == before


def test_full_disk_while_caching_is_one_line_and_resumes(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    really, left = os.write, [20_000]

    def write(file: int, content: Any) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        # A full disk takes part of a write, then refuses.
        written = really(file, memoryview(content)[: left[0]])
        left[0] -= written
        return written

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(InputError, match="No space left on device; make room") as caught:
        run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert "\n" not in str(caught.value)
    monkeypatch.undo()
    assert left_overs(tmp_path / "study") == []
    sizes = [path.stat().st_size for path in (tmp_path / "study" / "cache").rglob("*.safetensors")]
    assert 0 < sum(sizes) <= 20_000
    result = run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert result.n_ok + result.n_kept == 12
    assert 0 < result.n_described < 160, "what was written before the disk was full is kept"
    assert result.n_damaged == 0


def test_full_disk_while_writing_records(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(data)
    run_study(plan, tmp_path / "one", workers=0, cache=tmp_path / "cache")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(InputError, match="cannot write records"):
            run_study(plan, tmp_path / "two", workers=0, cache=tmp_path / "cache")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert list((tmp_path / "two" / "records").iterdir()) == []
    run_study(plan, tmp_path / "two", workers=0, cache=tmp_path / "cache")
    assert hashes(read_study(tmp_path / "two")) == hashes(read_study(tmp_path / "one"))


def test_a_changed_dataset_gives_new_results(data: Path, tmp_path: Path) -> None:
    run_study(tiny_plan(data), tmp_path / "study", workers=0)
    before = {record.run_id for record in read_study(tmp_path / "study")}
    changed = data / "noise" / "query" / "035.png"
    times = changed.stat().st_atime_ns, changed.stat().st_mtime_ns
    changed.write_bytes((data / "noise" / "query" / "003.png").read_bytes())
    # Same size of folder, same times: only the bytes tell.
    os.utime(changed, ns=times)
    result = run_study(tiny_plan(data), tmp_path / "study", workers=0)
    after = read_study(tmp_path / "study")
    assert (result.n_kept, result.n_ok) == (0, 12)
    assert before.isdisjoint(record.run_id for record in after)
    # Only the piece with the changed picture is described again, at both compressions.
    assert result.n_described == 2 * 8
    assert all(not r.answer_correct[35] for r in after if r.sequence_length == "1")


def test_a_picture_that_changes_while_the_study_runs(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def plan_and_change(*arguments: Any) -> Any:
        work = plan_work(*arguments)
        victim = data / "noise" / "query" / "001.png"
        victim.write_bytes((data / "noise" / "query" / "000.png").read_bytes())
        return work

    monkeypatch.setattr("retraverse.studies.engine.plan_work", plan_and_change)
    result = run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert result.n_failed == 12
    reasons = {record.error for record in read_study(tmp_path / "study")}
    assert reasons == {"001.png changed while the study ran; run it again"}


def test_a_technique_that_raises_spoils_only_its_own_runs(data: Path, tmp_path: Path) -> None:
    write_dataset(data / "bad", n_frames=40, marked=37)
    troubled = '[{ name = "tiny", parameters = { trouble = "raise" } }, "tiny"]'
    changes = {"techniques": troubled, "datasets": '["bad", "noise"]'}
    plan = tiny_plan(data, compression='{ levels = ["none"] }', **changes)
    result = run_study(plan, tmp_path / "study", workers=0)
    assert (result.n_ok, result.n_failed) == (9, 3)
    failed = [record for record in read_study(tmp_path / "study") if record.status == "failed"]
    assert {(record.dataset, record.error) for record in failed} == {
        ("bad", "tiny on 037.png: ValueError: a picture it cannot stand")
    }
    # The next time they are tried again, and what was done is kept.
    write_dataset(data / "bad", n_frames=40)
    again = run_study(plan, tmp_path / "study", workers=0)
    assert (again.n_failed, again.n_kept) == (0, 6)


def test_an_unreadable_picture_and_a_vanished_drive(data: Path, tmp_path: Path) -> None:
    write_dataset(data / "bad", n_frames=40)
    (data / "bad" / "query" / "007.png").write_bytes(b"\x89PNG\r\n\x1a\n broken")
    write_dataset(data / "gone", n_frames=40)
    plan = tiny_plan(data, datasets='["bad", "gone", "noise"]')
    for dataset in plan.datasets:
        dataset.query()
    (data / "gone" / "query" / "007.png").unlink()
    result = run_study(plan, tmp_path / "study", workers=0)
    assert (result.n_ok, result.n_failed) == (12, 13)
    errors = {r.dataset: r.error for r in read_study(tmp_path / "study") if r.status != "ok"}
    assert "007.png" in errors["bad"]
    assert "007.png" in errors["gone"]


@pytest.mark.parametrize("place", ["", "records"])
def test_what_a_killed_study_left_half_written_goes(data: Path, tmp_path: Path, place: str) -> None:
    folder = tmp_path / "study" / place
    folder.mkdir(parents=True)
    (folder / ".0123456789abcdef.tmp").write_bytes(b"half a plan or record")
    run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert left_overs(tmp_path) == []


def test_the_clock_set_back(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The wall clock runs backwards; durations must not notice.
    clock = iter(range(10**9, 0, -1000))
    monkeypatch.setattr(time, "time", lambda: float(next(clock)))
    result = run_study(tiny_plan(data), tmp_path / "study", workers=0)
    assert result.n_ok == 12
    assert 0 < result.seconds < 600
    for record in read_study(tmp_path / "study"):
        assert min(record.encode_s, record.match_s, record.vpr_s, record.compress_s) > 0
    assert run_study(tiny_plan(data), tmp_path / "study", workers=0).n_kept == 12


def test_a_lost_worker_costs_time_not_results(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    note = tmp_path / "death note"
    note.touch()
    monkeypatch.setenv(DEATH_NOTE, str(note))
    troubled = '[{ name = "tiny", parameters = { trouble = "die" } }]'
    plan = tiny_plan(data, techniques=troubled, compression='{ levels = ["none"] }')
    with caplog.at_level(logging.WARNING):
        result = run_study(plan, tmp_path / "study", workers=2)
    assert not note.exists(), "nobody died"
    assert (result.n_ok, result.n_failed) == (3, 0)
    assert "a worker was lost (exit code -9)" in caplog.text


def test_a_task_that_kills_every_worker_is_given_up(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "MOST_ATTEMPTS", 2)
    troubled = '[{ name = "tiny", parameters = { trouble = "always die" } }]'
    changes = {"compression": '{ levels = ["none"] }', "sequence_lengths": "[1]"}
    write_dataset(data / "small", n_frames=3)
    plan = tiny_plan(data, techniques=troubled, datasets='["small"]', **changes)
    result = run_study(plan, tmp_path / "study", workers=1)
    assert (result.n_ok, result.n_failed) == (0, 1)
    (record,) = read_study(tmp_path / "study")
    assert record.error == "its worker was lost 2 times (out of memory, or crashed?)"


def test_left_overs_of_the_living_stay(tmp_path: Path) -> None:
    folder = tmp_path / "cache" / "ab"
    folder.mkdir(parents=True)
    mine = folder / f".{cache_module._process()}-00.tmp"
    mine.touch()
    with subprocess.Popen([sys.executable, "-c", "pass"]) as process:
        pass
    host = cache_module._process().rpartition("-")[0]
    dead = folder / f".{host}-{process.pid}-00.tmp"
    dead.touch()
    elsewhere = folder / ".other-machine-1-00.tmp"
    elsewhere.touch()
    StudyCache(tmp_path / "cache")
    assert mine.exists()
    assert elsewhere.exists()
    assert not dead.exists()


def test_workers_end_with_the_process_they_serve(data: Path, tmp_path: Path) -> None:
    note = tmp_path / "hung"
    # Workers write to where the errors of their coordinator go: its end is the end of them all.
    coordinator = subprocess.Popen(
        [sys.executable, "-m", "tests.faults.study_process", str(data), "hang"],
        env={**os.environ, "PYTHONPATH": str(ROOT), DEATH_NOTE: str(note)},
        cwd=ROOT,
        stderr=subprocess.PIPE,
    )
    try:
        wait_for(lambda: len(list(tmp_path.glob("hung *"))) == 2, seconds=60)
    finally:
        coordinator.kill()
    began = time.monotonic()
    coordinator.communicate(timeout=HANG_S / 2)
    assert time.monotonic() - began < HANG_S / 2
    assert coordinator.returncode == -signal.SIGKILL
