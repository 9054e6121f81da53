"""Print what the study engine costs: chapter 6's grid, 1,000 trivial runs, two Dask workers.

Run: .venv/bin/python benchmarks/study_engine.py [DATA_FOLDER] [grid] [trivial] [dask]
Each number is one run on this machine as it is; "processor" is the time of this process and of
its workers, which other programs on the machine do not lengthen much.
"""

import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.studies.engine import run_study
from retraverse.studies.plans.plan_file import read_plan

GRID = """
name = "chapter 6 with HOG"
chapter = "6"
data = "{data}"
datasets = ["stromovka"]
techniques = [{{ name = "hog", parameters = {{ form = "chapter6" }} }}]
sequence_lengths = ["1..20"]
images = {{ resize = 256, resizer = "opencv", encoders = [{{ optimize = true }}] }}
[compression]
levels = [0, 50, 80, 90, 95, 97, 99]
pairs = ["uniform", "query", "reference"]
other = 0
"""
TRIVIAL = """
name = "1,000 trivial runs"
data = "{data}"
datasets = ["noise"]
techniques = [{{ name = "hog", parameters = {{ form = "chapter7", resolution = 16 }} }}]
sequence_lengths = ["1..10"]
images = {{ resize = 16 }}
[compression]
levels = [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]
pairs = ["grid"]
"""
LONG = """
name = "60 s of one worker"
data = "{data}"
datasets = ["noise"]
techniques = [{{ name = "hog" }}]
sequence_lengths = ["1..5"]
[compression]
levels = [0, 20, 40, 60, 80, 95]
pairs = ["uniform"]
"""


def main() -> None:
    words = sys.argv[1:]
    parts: dict[str, Callable[[Path, Path], None]] = {
        "grid": measure_grid,
        "trivial": measure_trivial,
        "dask": measure_dask,
    }
    data = Path(next((word for word in words if word not in parts), "../shared/data")).resolve()
    print(f"{os.cpu_count()} cores, load before: {os.getloadavg()[0]:.1f}")
    for name in [word for word in words if word in parts] or parts:
        with tempfile.TemporaryDirectory() as folder:
            parts[name](data, Path(folder))


def measure_grid(data: Path, folder: Path) -> None:
    if not (data / "stromovka").is_dir():
        print("chapter 6's grid: stromovka is not here")
        return
    text = GRID.format(data=data)
    for name, study in (("cold", "one"), ("cached", "two")):
        result, wall, processor = timed(text, folder / study, workers=2, cache=folder / "cache")
        print(
            f"chapter 6, HOG, {result.n_runs} runs, {name}: {wall:.2f} s, processor "
            f"{processor:.2f} s, {result.n_described} pictures described"
        )


def measure_trivial(data: Path, folder: Path) -> None:
    write_noise(folder / "noise", n_frames=12, shape=(16, 16))
    text = TRIVIAL.format(data=folder)
    result, wall, processor = timed(text, folder / "study", workers=2)
    print(
        f"{result.n_runs} trivial runs: {wall:.2f} s, {wall / result.n_runs * 1e3:.2f} ms a run; "
        f"processor {processor / result.n_runs * 1e3:.2f} ms a run; peak "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


def measure_dask(data: Path, folder: Path) -> None:
    import distributed

    write_noise(folder / "noise", n_frames=480, shape=(480, 640))
    walls = {}
    for n_workers in (1, 2):
        with distributed.LocalCluster(
            n_workers=n_workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
        ) as cluster:
            address = cluster.scheduler_address
            study = folder / f"study {n_workers}"
            text = LONG.format(data=folder)
            _, walls[n_workers], _ = timed(text, study, cluster=address)
        print(f"Dask, {n_workers} workers: {walls[n_workers]:.1f} s")
    print(f"2 workers are {walls[1] / walls[2]:.2f} times as fast as 1")


def timed(text: str, study: Path, **options: Any) -> tuple[Any, float, float]:
    """Run a study; return its result, wall seconds, and seconds of processor."""
    began, processor = time.perf_counter(), processor_s()
    result = run_study(read_plan(text), study, **options)
    return result, time.perf_counter() - began, processor_s() - processor


def processor_s() -> float:
    """Return the processor time of this process and of its children that have ended."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(sum(resource.getrusage(kind)[:2]) for kind in kinds)


def write_noise(folder: Path, *, n_frames: int, shape: tuple[int, int]) -> None:
    """Write two drives of noise."""
    import cv2

    rng = np.random.default_rng(0)
    for drive in ("query", "reference"):
        (folder / drive).mkdir(parents=True)
        for index in range(n_frames):
            rough = rng.integers(0, 255, (shape[0] // 8, shape[1] // 8), np.uint8)
            picture = cv2.resize(rough, shape[::-1])
            cv2.imwrite(str(folder / drive / f"{index:04d}.jpg"), picture)


if __name__ == "__main__":
    main()
