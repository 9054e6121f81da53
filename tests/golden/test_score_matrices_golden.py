"""Single-frame score matrices of Corridor against published programs.

Goldens: vprbench_CoHOG_corridor_py27.npz and vprbench_HOG_corridor_py27.npz, score matrices
(queries, references) written by VPR-Bench under Python 2.7 (HOG with OpenCV 4). CoHOG ran there
with an entropy threshold of 0.4. Grey path: "from_colour".
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.types import FloatArray

Shared = Callable[[str], Path]


def score_matrix(shared: Shared, name: str, **parameters: object) -> FloatArray:
    technique = rt.technique(name, **parameters)
    route = rt.build_map(rt.open_traverse(shared("data/corridor/reference")), technique)
    return rt.similarity(rt.open_traverse(shared("data/corridor/query")), route)


def test_cohog(shared: Shared) -> None:
    expected = np.load(shared("golden/vprbench_CoHOG_corridor_py27.npz"))["S"]
    scores = score_matrix(shared, "cohog", roi_entropy=0.4, grey="from_colour")
    np.testing.assert_allclose(scores, expected, atol=3e-3)


def test_hog(shared: Shared) -> None:
    expected = np.load(shared("golden/vprbench_HOG_corridor_py27.npz"))["S"]
    np.testing.assert_allclose(score_matrix(shared, "hog"), expected, atol=1e-2)


@pytest.mark.parametrize(("grey", "close"), [("from_colour", True), ("decoder", False)])
def test_descriptors_need_their_grey_path(shared: Shared, grey: str, close: bool) -> None:
    golden = np.load(shared("golden/cohog_descriptors_corridor_q0-2.npz"))
    technique = rt.technique("cohog", grey=grey)
    query = rt.open_traverse(shared("data/corridor/query"))
    for frame in range(3):
        ours = technique.describe(technique.read(query[frame]))["descriptor"]
        published = golden[f"d{frame}"]
        assert (np.abs(ours - published).max() <= 2e-3) == close
        if close:
            cosine = (ours.ravel() @ published.ravel()) / (
                np.linalg.norm(ours) * np.linalg.norm(published)
            )
            assert cosine > 0.99999
