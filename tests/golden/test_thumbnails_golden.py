"""SeqSLAM's thumbnails and difference matrix of Corridor against the original program.

Golden: openseqslam_octave_corridor.npz, written by the original OpenSeqSLAM under GNU Octave.
Its own 64 x 32 grey arrays are the input, since no other library repeats its resizing; its
matrix is (references, queries), of saturating differences divided by the number of references.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.techniques import Descriptions

Shared = Callable[[str], Path]


@pytest.fixture(scope="module")
def golden(shared: Shared) -> dict[str, Any]:
    return dict(np.load(shared("golden/openseqslam_octave_corridor.npz")))


def described(technique: Any, pictures: Any) -> Descriptions:
    """Return the descriptions of (32, 64, N) grey levels, rounded as MATLAB does."""
    rounded = np.floor(np.moveaxis(pictures, 2, 0) + 0.5).astype(np.uint8)
    return Descriptions.stack(map(technique.describe, rounded), technique.layout)


@pytest.mark.parametrize("drive", ["query", "ref"])
def test_normalised_thumbnails_are_the_same(golden: dict[str, Any], drive: str) -> None:
    ours = described(rt.technique("patchnorm"), golden[f"{drive}_32x64xN"]).descriptor
    theirs = golden[f"{drive}_pre"].reshape(64, 32, -1)  # column by column
    np.testing.assert_array_equal(ours.reshape(-1, 32, 64), theirs.transpose(2, 1, 0))


def test_difference_matrix(golden: dict[str, Any]) -> None:
    technique: Any = rt.technique("patchnorm", difference="saturating")
    queries = described(technique, golden["query_32x64xN"])
    references = described(technique, golden["ref_32x64xN"])
    sums = technique.differences(queries, references)
    np.testing.assert_allclose(sums / len(references), golden["D"].T, rtol=1e-4)
    # Matchers see similarities: the same matrix comes back from them.
    similarity = technique.similarity(queries, references)
    distances = (1 - similarity.astype(np.float64)) * 2048 * 16 / len(references)
    np.testing.assert_allclose(distances, golden["D"].T, rtol=1e-4)
