"""Print what fusing similarity matrices gains over the best single technique, as tables.

Run: .venv/bin/python benchmarks/fusion.py [DATA_FOLDER]

First the published matrices of ten techniques on Corridor: the cheap ones (CALC, CoHOG, HOG: the
three fastest to describe a picture, by the published times) and all. Then our own techniques on
every real drive that is here, single frames and windows of 10 (see _real_sets.py for tolerances).
Accuracy of the windows answered; the difference to the best single technique has its 95 % interval
(paired bootstrap over windows, 2,000 draws, seed 0). The best single technique is chosen by the
truth, which a user does not have: fusing all is what one does without it.
"""

from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from _real_sets import data_folder, real_sets

import retraverse as rt
from retraverse.matching import FusionMode, fuse
from retraverse.types import BoolArray, FloatArray

CHEAP = ("CALC", "CoHOG", "HOG")
OURS: dict[str, tuple[str, dict[str, Any]]] = {
    "hog": ("hog", {}),
    "cohog": ("cohog", {"precision": "int8"}),
    "gist": ("gist", {}),
    "orb": ("orb", {}),
    "patchnorm": ("patchnorm", {}),
    "sad": ("sad", {}),
}
MODES: tuple[FusionMode, ...] = get_args(FusionMode)
Matrices = Mapping[str, FloatArray]


def main() -> None:
    data = data_folder()
    published_table(data / "vprbench" / "scores_corridor.npz", data / "corridor")
    for real in real_sets(data):
        matrices = {}
        for name in known(OURS):
            technique = rt.technique(OURS[name][0], **OURS[name][1])
            matrices[name] = rt.similarity(real.query, rt.build_map(real.reference, technique))
        for length in (1, 10):
            print(f"\n**{real.name}**, K = {length}, {real.truth.description}\n")
            print_table({"all": tuple(matrices)}, matrices, real.truth, length)


def known(wanted: Mapping[str, object]) -> list[str]:
    """Return the names that the registry has."""
    registered = {info.name for info in rt.techniques()}
    return [name for name in wanted if name in registered]


def published_table(path: Any, corridor: Any) -> None:
    if not path.is_file():
        print(f"{path}: not here")
        return
    with np.load(path) as stored:
        matrices = {name: stored[name] for name in stored.files if "__" not in name}
    truth = rt.ground_truth(corridor / "ground_truth.json")
    truth = truth.bounded(next(iter(matrices.values())).shape[1])
    for length in (1, 10):
        print(f"\n**published matrices, corridor**, K = {length}, {truth.description}\n")
        print_table({"cheap": CHEAP, "all": tuple(matrices)}, matrices, truth, length)


def print_table(
    groups: Mapping[str, tuple[str, ...]], matrices: Matrices, truth: rt.GroundTruth, length: int
) -> None:
    print("| techniques | how | accuracy | less the best single | 95 % |")
    print("|---|---|---|---|---|")
    for group, names in groups.items():
        alone = {name: correct(matrices[name], truth, length) for name in names}
        best = max(alone, key=lambda name: alone[name].mean())
        for name in names:
            print(f"| {group} | {name} alone{' (best)' if name == best else ''} | "
                  f"{alone[name].mean():.3f} | | |")  # fmt: skip
        for mode in MODES:
            right = correct(fuse([matrices[name] for name in names], mode), truth, length)
            low, high = paired_interval(right, alone[best])
            print(
                f"| {group} | **{mode}** | {right.mean():.3f} | "
                f"{right.mean() - alone[best].mean():+.3f} | {low:+.3f} to {high:+.3f} |",
                flush=True,
            )


def correct(scores: FloatArray, truth: rt.GroundTruth, length: int) -> BoolArray:
    matches = rt.match_similarity(scores, sequence_length=length)
    return truth.is_correct(matches.query, matches.reference)


def paired_interval(right: BoolArray, other: BoolArray) -> tuple[float, float]:
    difference = right.astype(float) - other
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(difference), (2000, len(difference)))
    low, high = np.quantile(difference[draws].mean(axis=1), [0.025, 0.975])
    return float(low), float(high)


if __name__ == "__main__":
    main()
