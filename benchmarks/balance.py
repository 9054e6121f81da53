"""Print what balancing (holding back references that look like everything) gains, as a table.

Run: .venv/bin/python benchmarks/balance.py [DATA_FOLDER]

Each technique on each real drive that is here, windows of 10 frames matched by the mean of the
diagonal: plain, `RunningBalance` frame by frame, `balance` over the whole drive. The drive as it
is, then driven again at other speeds (retraverse.datasets.resample, seed 0; of nordland the
thinned drive). Windows that lie off the map in a detour have no right answer here.
"""

from typing import Any

import numpy as np
from _real_sets import accuracy, data_folder, real_sets

import retraverse as rt
from retraverse.datasets import plan_resampling
from retraverse.matching import RunningBalance, balance
from retraverse.types import FloatArray

TECHNIQUES: dict[str, dict[str, Any]] = {"hog": {}, "cohog": {"precision": "int8"}}
PROFILES = ("constant", "stops", "varying", "backwards", "detour", "jump")


def main() -> None:
    print("| drive | technique | profile | plain | running | whole drive |")
    print("|---|---|---|---|---|---|")
    for real in real_sets(data_folder()):
        for technique, parameters in TECHNIQUES.items():
            route = rt.build_map(real.reference, rt.technique(technique, **parameters))
            scores = rt.similarity(real.query, route)
            for profile in PROFILES:
                print_row(f"{real.name} | {technique}", profile, scores, real.truth)


def print_row(label: str, profile: str, scores: FloatArray, truth: rt.GroundTruth) -> None:
    resampling = plan_resampling(len(scores), profile, seed=0)
    driven = scores[np.ix_(resampling.frames, resampling.map_frames(truth))]
    cells = [
        f"{accuracy(matrix, resampling.truth(truth), 10):.3f}"
        for matrix in (driven, running(driven), balance(driven))
    ]
    print(f"| {label} | {profile} | {' | '.join(cells)} |", flush=True)


def running(scores: FloatArray) -> FloatArray:
    state = RunningBalance(scores.shape[1])
    return np.stack([state.update(row) for row in scores])


if __name__ == "__main__":
    main()
