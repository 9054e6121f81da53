"""SeqSLAM and OpenSeqSLAM2 against plain loops over cells, lines and windows."""

import math
from typing import Any

import numpy as np
import pytest
from tests.oracle.seqslam_loops import enhance_loops, match_loops

import retraverse as rt
from retraverse.kernels import trajectories
from retraverse.kernels.backend import native
from retraverse.matching.matchers.contrast import enhance_contrast
from retraverse.matching.matchers.openseqslam2 import OpenSeqSlam2, OpenSeqSlam2Parameters


@pytest.fixture(params=["native", "numpy"], autouse=True)
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(trajectories, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def random_differences(seed: int, *shape: int) -> Any:
    print("seed", seed)
    return np.random.default_rng(seed).random(shape, dtype=np.float32)


@pytest.mark.parametrize(("n", "radius"), [(30, 5), (8, 5), (3, 20), (40, 1), (2, 1)])
def test_contrast_enhancement(n: int, radius: int) -> None:
    differences = random_differences(n, 6, n) + np.float32(50)
    enhanced = enhance_contrast(differences, radius)
    expected = enhance_loops(differences.tolist(), radius)
    np.testing.assert_allclose(enhanced - enhanced.min(), expected, atol=2e-5)


def test_flat_neighbourhoods_stand_out_nowhere() -> None:
    differences = np.full((3, 40), 0.1, np.float32)
    differences[1, 30:] = 7
    enhanced = enhance_contrast(differences, 5)
    assert not enhanced[[0, 2]].any()
    assert not enhanced[1, :25].any()
    assert np.isfinite(enhanced).all()


@pytest.mark.parametrize(
    ("n_queries", "n_references", "ds"), [(25, 40, 10), (20, 12, 10), (9, 30, 4)]
)
def test_seqslam(n_queries: int, n_references: int, ds: int) -> None:
    differences = random_differences(n_references, n_queries, n_references)
    matches = rt.match_similarity(-differences, sequence_length=ds, matcher="seqslam")
    query, reference, ratio = zip(*match_loops(differences, ds), strict=True)
    assert matches.query.tolist() == list(query)
    assert matches.reference.tolist() == list(reference)
    expected = [1 - value if math.isfinite(value) and value > 0 else 0 for value in ratio]
    np.testing.assert_allclose(matches.score, expected, atol=1e-5)


# --- OpenSeqSLAM2 ----------------------------------------------------------------------------


def rounded(value: float) -> int:
    """Half away from zero, as MATLAB rounds."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def slow_lines(ds: int) -> list[list[int]]:
    half = ds // 2
    slopes = sorted({rounded(round(v * half, 9)) / half for v in (0.8, 0.9, 1.0, 1.1, 1.2)})
    return [[rounded(round(v * (t - half), 9)) for t in range(ds)] for v in slopes]


def slow_window(rows: Any, lines: list[list[int]], mode: str) -> list[float]:
    """Return the distance of every middle reference of one window."""
    n_steps, n = rows.shape
    best = [int(np.argmin(row)) for row in rows]
    distances = []
    for r in range(n):
        inside = [line for line in lines if all(0 <= r + o < n for o in line)]
        if mode == "hybrid":
            inside = [
                line for line in inside if any(r + o == b for o, b in zip(line, best, strict=True))
            ]
        if mode == "cone" and inside:
            hits = sum(
                r + min(line[t] for line in lines) <= best[t] <= r + max(line[t] for line in lines)
                for t in range(n_steps)
            )
            distances.append(1 - hits / n_steps)
        else:
            sums = [sum(float(rows[t, r + line[t]]) for t in range(n_steps)) for line in inside]
            distances.append(min(sums, default=math.inf))
    return distances


@pytest.mark.parametrize("mode", ["trajectory", "cone", "hybrid"])
@pytest.mark.parametrize(("ds", "n"), [(15, 40), (10, 25), (15, 16), (4, 20)])
def test_openseqslam2(mode: Any, ds: int, n: int) -> None:
    differences = random_differences(ds + n, ds + 9, n)
    matcher = OpenSeqSlam2(OpenSeqSlam2Parameters(search=mode))
    lines = slow_lines(ds)
    np.testing.assert_array_equal(matcher.lines(ds).offsets, lines)
    enhanced = enhance_contrast(differences, 5)
    enhanced -= enhanced.min()
    matches = matcher.match(-differences, ds)
    assert matches.query.tolist() == list(range(ds // 2, ds // 2 + 10))
    for window, (reference, score) in enumerate(zip(matches.reference, matches.score, strict=True)):
        distances = slow_window(enhanced[window : window + ds], lines, mode)
        best = min(distances)
        assert distances[reference] == pytest.approx(best, abs=1e-4)
        if mode == "cone":
            assert reference == distances.index(best)
        others = [d for r, d in enumerate(distances) if abs(r - reference) > 5]
        second = min(others, default=math.inf)
        known = math.isfinite(second) and second > 0
        assert score == pytest.approx(1 - best / second if known else 0, abs=1e-5)
