"""`retraverse study`: check, run, run again, show; what is wrong is said before anything runs."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.unit.studies.tiny import write_dataset

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = [sys.executable, "-c", "from retraverse.cli.main import run; run()"]
Run = Callable[..., subprocess.CompletedProcess[str]]
PLAN = """
name = "small"
data = "data"
datasets = ["noise"]
techniques = [{ name = "hog", parameters = { resolution = 64 } }]
sequence_lengths = ["1..3"]
compression = { levels = [50, 99] }
"""


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a function that runs the program where a plan and its data are."""
    write_dataset(tmp_path / "data" / "noise", n_frames=10)
    (tmp_path / "plan.toml").write_text(PLAN)

    def run_it(*words: object) -> subprocess.CompletedProcess[str]:
        command = [*PROGRAM, "study", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)

    return run_it


def test_the_plan_of_the_docs_on_a_road_of_ones_own(tmp_path: Path) -> None:
    """Its pictures are found again without being told where they are."""
    text = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    plan = text.partition("```toml\n")[2].partition("```")[0]
    # A tenth of its runs: what is tried here is that the text is a plan.
    small = plan.replace("[1, 5, 10]", "[2]").replace("[0, 90, 97]", "[97]")
    (tmp_path / "plan.toml").write_text(small)
    drives = write_dataset(tmp_path / "noise", n_frames=12)
    (drives / "query").rename(tmp_path / "snow")
    (drives / "reference").rename(tmp_path / "autumn")

    def run_it(*words: str) -> subprocess.CompletedProcess[str]:
        command = [*PROGRAM, "study", *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)

    done = run_it("run", "plan.toml", "--out", "study", "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "24 runs: 24 done now" in done.stdout
    assert run_it("report", "study", "--out", "pages").returncode == 0
    assert list((tmp_path / "pages" / "pictures").rglob("*.jpg"))


def test_check_run_again_show(run: Run, tmp_path: Path) -> None:
    checked = run("check", "plan.toml", "--workers", 1, "--json")
    assert checked.returncode == 0, checked.stderr
    estimate = json.loads(checked.stdout)
    assert (estimate["n_runs"], estimate["n_pictures"]) == (6, 40)
    assert not (tmp_path / "study").exists()

    first = run("run", "plan.toml", "--out", "study", "--workers", 1)
    assert first.returncode == 0, first.stderr
    assert "6 runs: 6 done now, 0 before, 0 failed, 0 missing; 40 pictures" in first.stdout
    assert (tmp_path / "study" / "plan.toml").read_text() == PLAN

    reported = run("report", "study", "--out", "pages")
    assert reported.returncode == 0, reported.stderr
    assert "holds: Image bytes fall with the compression c." in reported.stdout
    assert (tmp_path / "pages" / "index.html").is_file()
    assert list((tmp_path / "pages" / "pictures").rglob("*.jpg"))
    words = ("report", "study", "--out", "bare", "--no-pictures")
    assert run(*words).returncode == 0
    assert not (tmp_path / "bare" / "pictures").exists()

    again = json.loads(run("run", "plan.toml", "--out", "study", "--json").stdout)
    assert (again["n_ok"], again["n_kept"]) == (0, 6)

    shown = json.loads(run("show", "study", "--json").stdout)
    assert {(row["K"], row["c"]) for row in shown} == {
        (k, c) for k in "123" for c in ("50/50", "99/99")
    }
    assert "hog" in run("show", "study").stdout


def test_problems_come_all_at_once_and_nothing_is_run(run: Run, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('datasets = ["a", "b"]\ntechniques = ["hogg"]\nnam = 1')
    for words in (("check", "plan.toml"), ("run", "plan.toml", "--out", "study")):
        done = run(*words)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 5
        assert "plan plan.toml: 4 problems" in done.stderr
    assert not (tmp_path / "study").exists()


def test_missing_datasets_may_be_left_out(run: Run, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN.replace('["noise"]', '["noise", "sped"]'))
    words = ("run", "plan.toml", "--out", "study", "--workers", 0, "--skip-missing")
    done = run(*words)
    assert done.returncode == 0, done.stderr
    assert "6 done now, 0 before, 0 failed, 1 missing" in done.stdout
    assert "dataset sped: not here" in done.stderr


def test_nothing_to_show(run: Run) -> None:
    done = run("show", "elsewhere")
    assert done.returncode == 2
    assert "no such file or folder" in done.stderr
