"""`retraverse view` as a user meets it: an address, pages, and a clean end."""

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

from tests.unit.reports.study_report.made_up import make_run, write_study

COMMAND = [sys.executable, "-c", "from retraverse.cli.main import run; run()", "view"]
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1"}


def test_view_serves_until_ctrl_c(tmp_path: Path) -> None:
    study = write_study(tmp_path / "study", [make_run()])
    (tmp_path / "tmp").mkdir()
    process = subprocess.Popen(
        [*COMMAND, str(study)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**ENVIRONMENT, "TMPDIR": str(tmp_path / "tmp")},
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), process.communicate()[1]
        with urllib.request.urlopen(address, timeout=60) as answer:
            assert b"1 run: 1 technique on 1 dataset" in answer.read()
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in complaints
    assert list((tmp_path / "tmp").iterdir()) == []


def test_what_is_no_study_is_said_in_one_line(tmp_path: Path) -> None:
    result = subprocess.run(
        [*COMMAND, str(tmp_path)], capture_output=True, text=True, check=False, env=ENVIRONMENT
    )
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "no study here" in result.stderr
