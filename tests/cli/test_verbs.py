"""Every verb on a small simulated route, as a user would type it."""

import csv
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from retraverse.cli.main import VERBS, app
from retraverse.datasets.simulated import Disturbances, simulate_route, write_drive

PROGRAM = [sys.executable, "-c", "from retraverse.cli.main import run; run()"]
Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the folders of two short drives through one street."""
    folder = tmp_path_factory.mktemp("drives")
    route = simulate_route(3, 24, query=Disturbances(season=0.5, lateral_shift=0.2))
    return (
        write_drive(route.reference, folder / "reference"),
        write_drive(route.query, folder / "query"),
    )


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a function that runs the program in an empty folder."""

    def run_it(*words: object) -> subprocess.CompletedProcess[str]:
        command = [*PROGRAM, *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)

    return run_it


def verbs_of(command: Any, words: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield every verb below a command, as typed."""
    if not hasattr(command, "commands"):
        yield " ".join(words)
        return
    for name, one in command.commands.items():
        yield from verbs_of(one, (*words, name))


def test_every_verb_is_listed() -> None:
    assert sorted(VERBS) == sorted(verbs_of(get_command(app)))


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_help(run: Run, verb: str) -> None:
    done = run(*verb.split(), "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout
    assert done.stderr == ""


def test_version(run: Run) -> None:
    import retraverse

    assert run("--version").stdout.strip() == f"retraverse {retraverse.__version__}"


def test_compare_writes_a_report_and_says_what_it_found(
    run: Run, drives: tuple[Path, Path], tmp_path: Path
) -> None:
    done = run("compare", *drives, "--radius", 4, "--technique", "hog", "-k", 4, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["n_queries"] == result["n_references"] == 24
    assert result["n_answered"] == 21
    assert result["n_unanswered"] == 3
    assert result["evaluation"]["accuracy"] > 0.8
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.lower().startswith("<!doctype html>")
    assert "retraverse" in page


def test_compare_without_truth(run: Run, drives: tuple[Path, Path]) -> None:
    done = run("compare", *drives, "--technique", "hog", "-k", 1, "-o", "page.html", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["evaluation"] is None


def test_map_localize_evaluate(run: Run, drives: tuple[Path, Path], tmp_path: Path) -> None:
    reference, query = drives
    built = run("map", "build", reference, "--out", "route.map", "-t", "hog", "--json")
    assert built.returncode == 0, built.stderr
    again = run("map", "build", reference, "--out", "route.map", "-t", "hog")
    assert again.returncode == 2
    assert again.stderr.count("\n") == 1
    info = json.loads(run("map", "info", "route.map", "--json").stdout)
    assert info["n_frames"] == 24
    located = run("localize", "route.map", query, "-k", 3, "--json")
    assert located.returncode == 0, located.stderr
    with (tmp_path / "matches.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 24
    assert [row["reference"] for row in rows[-2:]] == ["", ""]
    assert rows[0]["query_name"] == "0000.jpg"
    judged = run(
        "evaluate", "matches.csv", "--json",
        "--query-positions", query / "positions.csv",
        "--reference-positions", reference / "positions.csv", "--radius", 4,
    )  # fmt: skip
    assert judged.returncode == 0, judged.stderr
    numbers = json.loads(judged.stdout)
    assert numbers["n_unanswered"] == 2
    assert numbers["accuracy"] > 0.8
    assert set(numbers["definitions"]) >= {"accuracy", "auc", "r_p100"}
    extended = run("map", "extend", "route.map", query, "--json")
    assert extended.returncode == 0, extended.stderr
    assert json.loads(extended.stdout)["n_frames"] == 48


def test_workers_build_and_extend_the_same_map(run: Run, drives: tuple[Path, Path]) -> None:
    contents = []
    for out, words in (("alone.map", ()), ("many.map", ("--workers", 1))):
        built = run("map", "build", drives[0], "--out", out, "-t", "hog", *words, "--json")
        assert built.returncode == 0, built.stderr
        extended = run("map", "extend", out, drives[1], *words, "--json")
        assert extended.returncode == 0, extended.stderr
        contents.append(json.loads(extended.stdout)["content_sha256"])
    assert contents[0] == contents[1]
    kinds = ("--workers", 1, "--cluster", "local:1")
    both = run("map", "build", drives[0], "--out", "third.map", *kinds)
    assert both.returncode == 2
    assert "got workers and a cluster" in both.stderr


def test_localize_dynamic(run: Run, drives: tuple[Path, Path], tmp_path: Path) -> None:
    run("map", "build", drives[0], "--out", "route.map", "--set", "precision=int8")
    done = run("localize", "route.map", drives[1], "-k", "dynamic", "--threshold", 0.0)
    assert done.returncode == 0, done.stderr
    assert "matches.csv" in done.stdout


def test_techniques_lists_every_parameter(run: Run) -> None:
    listed = json.loads(run("techniques", "--json").stdout)
    by_name = {entry["name"]: entry for entry in listed}
    assert {"hog", "cohog", "convsequential"} <= set(by_name)
    parameters = {item["name"]: item for item in by_name["convsequential"]["parameters"]}
    assert parameters["roi"]["choices"] == ["first", "each"]
    assert "max_sequence_length" in run("techniques").stdout


def test_matchers_say_what_they_cost_and_assume(run: Run) -> None:
    listed = {entry["name"]: entry for entry in json.loads(run("matchers", "--json").stdout)}
    assert set(listed) >= {"mean", "seqslam", "openseqslam2", "dtw", "hmm", "graph", "auto"}
    assert all(entry["cost"] and entry["assumes"] for entry in listed.values())
    assert listed["hmm"]["frame_by_frame"]
    text = run("matchers").stdout
    assert "slope_aware | original" in text
    assert "assumes: " in text


def test_compare_and_localize_by_another_matcher(
    run: Run, drives: tuple[Path, Path], tmp_path: Path
) -> None:
    words = ["--matcher", "seqslam", "--matcher-set", "index=original", "-t", "hog", "--json"]
    done = run("compare", *drives, "--radius", 4, *words)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["provenance"]["matcher"] == "seqslam(index=original)"
    assert result["provenance"]["sequence_length"] == "10"
    assert result["n_answered"] == 14
    automatic = json.loads(run("compare", *drives, "-t", "hog", "-m", "auto", "--json").stdout)
    assert automatic["notes"][0].startswith("auto picked ")
    run("map", "build", drives[0], "--out", "route.map", "-t", "hog")
    located = run("localize", "route.map", drives[1], "-k", 4, "-m", "dtw", "--json")
    assert json.loads(located.stdout)["n_answered"] == 24
    with (tmp_path / "matches.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert all(row["frame_reference"] == row["reference"] for row in rows)


def test_doctor(run: Run) -> None:
    assert json.loads(run("doctor", "--json").stdout)["kernels"] in ("native", "numpy")


def test_simulate_then_compare(run: Run) -> None:
    made = run("datasets", "simulate", "street", "--frames", 6, "--night", 0.4, "--json")
    assert made.returncode == 0, made.stderr
    written = json.loads(made.stdout)
    assert written["n_references"] == 6
    done = run("compare", written["reference"], written["query"], "-k", 2, "--radius", 3)
    assert done.returncode == 0, done.stderr
    assert "accuracy" in done.stdout


def test_demo(run: Run, tmp_path: Path) -> None:
    done = run("demo", "--frames", 8)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "demo" / "report.html").stat().st_size > 10_000
    assert run("demo", "--frames", 8).returncode == 0
    (tmp_path / "mine").mkdir()
    refused = run("demo", "--out", "mine")
    assert refused.returncode == 2
    assert (tmp_path / "mine").is_dir()


BAD = [
    (["compare", "nowhere", "nowhere"], "nowhere"),
    (["compare", "{reference}", "{query}", "-t", "hogg"], "did you mean 'hog'"),
    (["compare", "{reference}", "{query}", "-t", "hog", "--every", "20"], "at least 3 frames"),
    (["compare", "{reference}", "{query}", "-k", "0"], "whole number from 1"),
    (["compare", "{reference}", "{query}", "-k", "-3"], "whole number from 1"),
    (["compare", "{reference}", "{query}", "-t", "hog", "-k", "25"], "only 24 frames"),
    (["compare", "{reference}", "{query}", "--set", "roi"], "NAME=VALUE"),
    (["compare", "{reference}", "{query}", "--set", "roi=last"], "'first', 'each'"),
    (["compare", "{reference}", "{query}", "--set", "roi_entropy=0.8"], "0.7925"),
    (["compare", "{reference}", "{query}", "--aligned", "2", "--radius", "3"], "--aligned and"),
    (
        ["compare", "{reference}", "{query}", "-t", "hog", "-k", "1", "-o", "no/where.html"],
        "does not exist",
    ),
    (["map", "info", "{reference}"], "not a route map"),
    (["localize", "{reference}", "{query}"], "not a route map"),
    (["compare", "{reference}", "{query}", "-m", "dwt"], "did you mean 'dtw'"),
    (["compare", "{reference}", "{query}", "-m", "hmm", "-k", "dynamic"], "does not offer it"),
    (["compare", "{reference}", "{query}", "--matcher-set", "x"], "--matcher-set: got 'x'"),
    (["compare", "{reference}", "{query}", "-m", "hmm", "--matcher-set", "jump=2"], "1e-12 to 0.4"),
    (["evaluate", "none.csv", "--aligned", "2"], "no such file"),
    (["evaluate", "{reference}/positions.csv", "--aligned", "2"], "column"),
    (["datasets", "simulate", "{reference}/..", "--frames", "5"], "folder"),
]


@pytest.mark.parametrize(("words", "said"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_gets_one_line(
    run: Run, drives: tuple[Path, Path], tmp_path: Path, words: list[str], said: str
) -> None:
    filled = [word.format(reference=drives[0], query=drives[1]) for word in words]
    done = run(*filled)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_wrong_option_is_the_users_mistake(run: Run) -> None:
    done = run("compare", "--no-such-option")
    assert done.returncode == 2
    assert "no-such-option" in done.stderr


def test_bad_picture_is_named_or_skipped(
    run: Run, drives: tuple[Path, Path], tmp_path: Path
) -> None:
    damaged = tmp_path.parent / f"{tmp_path.name}-damaged"
    shutil.copytree(drives[1], damaged)
    picture = damaged / "0007.jpg"
    picture.write_bytes(picture.read_bytes()[:900])
    stopped = run("compare", drives[0], damaged, "-t", "hog", "-k", 1, "--radius", 4)
    assert stopped.returncode == 2
    assert "0007.jpg" in stopped.stderr
    assert list(tmp_path.iterdir()) == []
    skipped = run(
        "compare", drives[0], damaged, "-t", "hog", "-k", 1, "--radius", 4, "--skip-bad", "--json"
    )
    assert skipped.returncode == 0, skipped.stderr
    result = json.loads(skipped.stdout)
    assert result["n_queries"] == 23
    assert any("could not be read" in note for note in result["notes"])
