"""Scheduler and workers as separate processes, by TLS, as docs/cluster.md tells to start them."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from tests.unit.studies.tiny import (
    ROOT,
    hashes,
    tiny_plan,
    tiny_registered,
    wait_for,
    write_dataset,
)

from retraverse.errors import ConfigError, InputError, MissingExtraError
from retraverse.studies.engine import run_study
from retraverse.studies.keeping.study_folder import read_study
from retraverse.studies.tasks import cluster

GUIDE = ROOT / "docs" / "cluster.md"


@pytest.fixture(autouse=True)
def _tiny() -> Iterator[None]:
    with tiny_registered():
        yield


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_dataset(tmp_path / "data" / "noise", n_frames=40)
    return tmp_path / "data"


def make_certificates(folder: Path) -> dict[str, str]:
    """Run the guide's own commands; return the environment it exports."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here to make certificates with")
    folder.mkdir()
    guide = GUIDE.read_text(encoding="utf-8")
    blocks = re.findall(r"```console\n(.*?)```", guide, re.DOTALL)
    making = next(block for block in blocks if "openssl" in block)
    telling = next(block for block in blocks if "REQUIRE_ENCRYPTION" in block)
    script = "\n".join(line.removeprefix("$ ").removeprefix("> ") for line in
                       (making + telling).splitlines())  # fmt: skip
    shell = subprocess.run(
        ["bash", "-ec", f"{script}\nenv"], cwd=folder, capture_output=True, text=True, check=True
    )
    lines = [line for line in shell.stdout.splitlines() if line.startswith("DASK_DISTRIBUTED__")]
    return dict(line.split("=", 1) for line in lines)


@contextmanager
def process(environment: dict[str, str], *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a Dask program while the block lasts; end it and nothing else."""
    started = subprocess.Popen(
        [sys.executable, "-m", "dask", *words],
        env={**os.environ, **environment, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield started
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
        started.wait()


def test_tls_cluster_gives_the_same_records_though_a_worker_is_killed(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dask = pytest.importorskip("dask", reason="the extra cluster is not installed")
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    environment = make_certificates(tmp_path / "certificates")
    slow = '[{ name = "tiny", parameters = { trouble = "die" } }, "tiny"]'
    plan = tiny_plan(data, techniques=slow)
    monkeypatch.setattr(cluster, "WORKERS_S", 240)
    where = tmp_path / "scheduler.json"
    note = tmp_path / "death note"
    note.touch()
    settings = {
        name.removeprefix("DASK_").lower().replace("__", "."): value == "True" or value
        for name, value in environment.items()
    }
    with ExitStack() as stack:
        words = ["scheduler", "--protocol", "tls", "--no-dashboard", "--host", "127.0.0.1"]
        words += ["--port", "0", "--scheduler-file", str(where)]
        stack.enter_context(process(environment, *words))
        wait_for(lambda: where.exists() and where.stat().st_size > 0, seconds=120)
        address = json.loads(where.read_text())["address"]
        fatal = {**environment, "RETRAVERSE_TEST_DEATH_NOTE": str(note)}
        for _ in range(2):
            stack.enter_context(
                process(fatal, "worker", address, "--nthreads", "1", "--no-dashboard")
            )
        with dask.config.set(settings):
            result = run_study(plan, tmp_path / "cluster", cluster=address)
    assert not note.exists(), "no worker died"
    assert (result.n_ok, result.n_failed) == (24, 0)
    run_study(plan, tmp_path / "here", workers=0)
    assert hashes(read_study(tmp_path / "cluster")) == hashes(read_study(tmp_path / "here"))


@pytest.mark.parametrize("address", ["local", "local:0", "local:x", "127.0.0.1:8786", ""])
def test_wrong_addresses(address: str) -> None:
    with pytest.raises(ConfigError, match="expected tcp://HOST:PORT, tls://HOST:PORT or local"):
        cluster.check_address(address)


def test_nothing_answers(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr(cluster, "CONNECT_S", 0.2)
    with socket.socket() as nobody:  # Bound and not listening: nobody else gets the port.
        nobody.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(InputError, match="nothing answers"):
            run_study(tiny_plan(data), tmp_path / "study", cluster=address)


def test_without_dask(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'retraverse\[cluster\]'"):
        run_study(tiny_plan(data), tmp_path / "study", cluster="local:1")
