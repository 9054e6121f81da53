"""Kill -9 at any instant of a training: resumed, it ends where an uninterrupted one does."""

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.faults import training_victim
from tests.unit.training.tiny import Line

from retraverse.training.loop import CHECKPOINT, run_loop

ROOT = Path(__file__).resolve().parents[2]


def test_killed_and_resumed_equals_uninterrupted(tmp_path: Path) -> None:
    seed = random.randrange(2**32)
    print("seed", seed)
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    killed.mkdir()
    whole.mkdir()
    done = subprocess.run(
        [sys.executable, training_victim.__file__, str(killed), str(seed)],
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    expected = run_loop(Line(), training_victim.SETTINGS, whole)
    weights = [value for one in expected.network.parameters() for value in one.flatten().tolist()]
    assert result["n_resumed"] >= 1, "no kill hit a training at work: this would test nothing"
    assert result["first_step"] > 0
    np.testing.assert_allclose(result["weights"], weights, rtol=1e-5)
    assert result["losses"] == pytest.approx(expected.losses[-3:], rel=1e-5)
    # A write that was cut short leaves its own file behind at worst, never half a checkpoint.
    left = {path.name for path in killed.iterdir() if not path.name.startswith(".")}
    assert left == {CHECKPOINT, "result.json"}
