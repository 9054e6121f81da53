"""Ctrl-C at any time ends with 130, one word, and nothing half-written."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from retraverse import load_map
from retraverse.datasets.simulated import simulate_route, write_drive

PROGRAM = [sys.executable, "-c", "from retraverse.cli.main import run; run()"]


@pytest.mark.heavy
def test_interrupt_at_random_instants(tmp_path: Path, scaled: Callable[[int], int]) -> None:
    route = simulate_route(5, 40)
    for name, drive in (("reference", route.reference), ("query", route.query)):
        write_drive(drive, tmp_path / name)
    seed = int(os.environ.get("RETRAVERSE_SEED", random.randrange(2**32)))
    print(f"seed {seed}")
    choose = random.Random(seed)
    work = tmp_path / "work"
    work.mkdir()
    codes = []
    for _ in range(scaled(10)):
        process = subprocess.Popen(
            [*PROGRAM, "map", "build", str(tmp_path / "reference"), "--out", "route.map"],
            cwd=work, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        time.sleep(choose.uniform(0.5, 2.5))
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        codes.append(process.returncode)
        left = sorted(path.name for path in work.iterdir() if not path.name.endswith(".lock"))
        # An interrupt before our first line runs, or after our last, ends Python by the signal.
        assert process.returncode in (0, 130, -signal.SIGINT), said
        assert "Traceback" not in said or process.returncode == -signal.SIGINT
        assert left in ([], ["route.map"])
        assert left or process.returncode != 0
        if left:
            assert len(load_map(work / "route.map")) == 40
            shutil.rmtree(work / "route.map")
    print(codes)
