"""`retraverse weights` as a user types it, offline."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.file_server import serving

from retraverse.cli.main import app
from retraverse.errors import ConfigError, DataMissingError, InputError

PROGRAM = [sys.executable, "-c", "from retraverse.cli.main import run; run()"]
Run = Callable[..., str]


@pytest.fixture(autouse=True)
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put the store in an empty folder."""
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path / "store"))
    return tmp_path / "store"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Return a function that runs the verb in this process and gives what it printed."""

    def run_it(*words: object) -> str:
        capsys.readouterr()
        app(["weights", *map(str, words)], standalone_mode=False)
        return capsys.readouterr().out

    return run_it


def toy(path: Path, value: float = 1.0) -> Path:
    np.savez(path, weight=np.full((2, 3), value, np.float32))
    return path


def test_list_import_verify(run: Run, tmp_path: Path, store: Path) -> None:
    path = json.loads(run("import", toy(tmp_path / "mine.npz"), "--json"))["path"]
    assert path == str(store / "mine.safetensors")
    listed = json.loads(run("list", "--json"))
    here = {row["name"] for row in listed["weights"] if row["here"]}
    assert here - {"efficientnet-lite0"} == {"mine"}
    assert listed["folder"] == str(store)
    of_one = json.loads(run("list", "--technique", "boq", "--json"))["weights"]
    assert [row["name"] for row in of_one] == ["boq-dinov2-12288", "boq-resnet50-16384"]
    assert "cosplace-resnet101-1024" in run("list")
    assert run("verify").split()[-2:] == ["mine", "ok"]


def test_verify_fails_on_what_changed(run: Run, tmp_path: Path, store: Path) -> None:
    run("import", toy(tmp_path / "mine.npz"))
    (store / "mine.safetensors").write_bytes(b"x")
    with pytest.raises(InputError, match="weights mine: not as recorded"):
        run("verify", "--json")


def test_get_as_a_program(tmp_path: Path, store: Path) -> None:
    with serving(toy(tmp_path / "mine.npz").read_bytes()) as server:
        command = [*PROGRAM, "weights", "get", "megaloc", "--from", server.address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(store / "megaloc.safetensors")
    assert "please cite Berton" in done.stderr


def test_get_refuses_what_differs_from_the_first(run: Run, tmp_path: Path, store: Path) -> None:
    with serving(toy(tmp_path / "mine.npz").read_bytes()) as server:
        run("get", "megaloc", "--from", server.address)
        server.content = toy(tmp_path / "other.npz", 2.0).read_bytes()
        with pytest.raises(InputError, match="got SHA-256"):
            run("get", "megaloc", "--from", server.address)
        assert run("verify").split()[-2:] == ["megaloc", "ok"]
        run("get", "megaloc", "--from", server.address, "--accept-changed")
        with pytest.raises(InputError, match=r"the server has .* expected 620796"):
            run("get", "binarynet", "--from", server.address)


@pytest.mark.parametrize(
    ("words", "error", "message"),
    [
        (("get", "cosplace"), ConfigError, "unknown weights: got 'cosplace'"),
        (("get", "calc", "--from", "ftp://x/y"), InputError, "expected http"),
        (("get", "calc", "--from", "no.tar.gz"), DataMissingError, "there is no file 'no.tar.gz'"),
        (("import", "absent.pth"), DataMissingError, "there is no file 'absent.pth'"),
        (("verify", "calc"), DataMissingError, "'calc' is not in"),
    ],
)
def test_wrong_input_is_said_in_one_line(
    run: Run, words: tuple[str, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        run(*words)
    assert "\n" not in str(caught.value)
