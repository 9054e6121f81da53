"""`retraverse reproduce`: a chapter on one's own route, its report, and again after a break."""

import json
import re
import subprocess
import sys
from pathlib import Path

from tests.unit.studies.tiny import write_dataset

PROGRAM = [sys.executable, "-c", "from retraverse.cli.main import run; run()", "reproduce"]


def reproduce(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*PROGRAM, *words], cwd=folder, capture_output=True, text=True, timeout=300
    )


def test_a_chapter_on_ones_own_route(tmp_path: Path) -> None:
    write_dataset(tmp_path / "data" / "mine", n_frames=22)
    words = ("data", "--dataset", "mine", "--chapter", "3", "--workers", "1", "--json")
    first = reproduce(tmp_path, *words)
    assert first.returncode == 0, first.stderr
    found = json.loads(first.stdout)
    study = found["studies"]["chapter 3"]
    assert study["n_failed"] == 0
    assert study["n_ok"] + study["n_missing"] == study["n_runs"]
    # ConvSequential-SLAM at 1 to 20 and dynamic, CoHOG, HOG, SeqSLAM twice: nothing to download.
    assert study["n_ok"] == 21 + 1 + 1 + 2
    page = (tmp_path / found["report"]).read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=.https?:", page)
    assert "weights get calc" in page
    assert (tmp_path / "reproduction" / "report" / "chapter-3.html").is_file()

    again = json.loads(reproduce(tmp_path, *words).stdout)
    assert again["studies"]["chapter 3"]["n_kept"] == study["n_ok"]


def test_nothing_to_reproduce(tmp_path: Path) -> None:
    done = reproduce(tmp_path, str(tmp_path))
    assert done.returncode == 2
    assert "none of corridor" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "reproduction").exists()
