"""Regional HOG against the authors' own program (CoHOG, Python 2.7 build) on real frames.

Golden: descriptors of the first three queries of the corridor, grey path "from_colour".
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from retraverse.kernels import encoding, regional_hog
from retraverse.kernels.backend import native


@pytest.mark.parametrize("kernels", ["native", "numpy"])
@pytest.mark.parametrize("query", [0, 1, 2])
def test_corridor_descriptors(
    query: int, kernels: str, shared: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    if kernels == "numpy":
        monkeypatch.setattr(encoding, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")
    golden = np.load(shared("golden/cohog_descriptors_corridor_q0-2.npz"))[f"d{query}"]
    colour: Any = cv2.imread(str(shared("data/corridor/query") / f"{query:07d}.jpg"))
    grey: Any = cv2.resize(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), (512, 512))
    descriptor = regional_hog(grey).astype(np.float64)
    assert np.abs(descriptor - golden).max() < 2e-3
    lengths = np.linalg.norm(descriptor, axis=1) * np.linalg.norm(golden, axis=1)
    cosine = (descriptor * golden).sum(axis=1) / lengths
    assert cosine.min() > 0.99999
