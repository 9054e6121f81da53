"""Fusion on published matrices: ten techniques on Corridor, as VPR-Bench publishes them.

Source: scores_corridor.npz, similarity (queries, references) of ten techniques, with the times
each takes; ground_truth.json of the same set (±2 frames).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.matching import FusionMode, fuse
from retraverse.types import FloatArray

Shared = Callable[[str], Path]
CHEAP = ("CALC", "CoHOG", "HOG")


@pytest.fixture(scope="module")
def matrices(shared: Shared) -> dict[str, FloatArray]:
    with np.load(shared("data/vprbench/scores_corridor.npz")) as stored:
        return {name: stored[name] for name in stored.files if "__" not in name}


@pytest.fixture(scope="module")
def truth(shared: Shared) -> rt.GroundTruth:
    return rt.ground_truth(shared("data/corridor/ground_truth.json"), n_references=111)


def accuracy(scores: FloatArray, truth: rt.GroundTruth) -> float:
    return rt.evaluate(rt.match_similarity(scores, sequence_length=1), truth).accuracy


def test_the_cheap_ones_are_the_cheapest(shared: Shared) -> None:
    with np.load(shared("data/vprbench/scores_corridor.npz")) as stored:
        seconds = {
            key.removesuffix("__sec"): stored[key][0] for key in stored.files if "__sec" in key
        }
    assert sorted(sorted(seconds, key=seconds.__getitem__)[:3]) == sorted(CHEAP)


@pytest.mark.parametrize("group", ["cheap", "all", "all but the best"])
def test_the_default_beats_the_best_single_technique(
    matrices: dict[str, FloatArray], truth: rt.GroundTruth, group: str
) -> None:
    alone = {name: accuracy(matrix, truth) for name, matrix in matrices.items()}
    best = max(alone, key=alone.__getitem__)
    names = {
        "cheap": list(CHEAP),
        "all": list(matrices),
        "all but the best": [name for name in matrices if name != best],
    }[group]
    fused = accuracy(fuse([matrices[name] for name in names]), truth)
    assert fused > max(alone[name] for name in names)


@pytest.mark.parametrize("mode", ["rank", "switch"])
def test_the_other_modes_lose_to_the_default(
    matrices: dict[str, FloatArray], truth: rt.GroundTruth, mode: FusionMode
) -> None:
    for names in (list(CHEAP), list(matrices)):
        listed = [matrices[name] for name in names]
        assert accuracy(fuse(listed, mode), truth) < accuracy(fuse(listed), truth)
