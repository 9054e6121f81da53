"""Sequence scores against algorithms 4 and 5 written out as loops over exact fractions."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from retraverse.kernels import DiagonalSums, best_diagonals, diagonal, diagonal_scores
from retraverse.kernels.backend import native


@pytest.fixture(params=["native", "numpy"], autouse=True)
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(diagonal, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def slow_scores(similarity: Any, length: int) -> list[list[float]]:
    """Mean of each window's pairs, as a fraction, then the nearest float32."""
    n_queries, n_references = similarity.shape
    rows = []
    for query in range(n_queries - length + 1):
        row = []
        for reference in range(n_references - length + 1):
            total = Fraction(0)
            for t in range(length):
                total += Fraction(float(similarity[query + t, reference + t]))
            row.append(float(np.float32(float(total / length))))
        rows.append(row)
    return rows


def slow_best(scores: list[float]) -> tuple[int, float]:
    best = 0
    for reference, score in enumerate(scores):
        if score > scores[best]:
            best = reference
    return best, scores[best]


@pytest.mark.parametrize("shape", [(14, 14), (9, 20), (20, 9), (1, 6), (6, 1)])
@pytest.mark.parametrize("levels", [3, 2**24])
def test_every_length(shape: tuple[int, int], levels: int) -> None:
    seed = shape[0] + levels
    print("seed", seed)
    whole = np.random.default_rng(seed).integers(-levels, levels + 1, shape)
    similarity = (whole / levels if levels > 3 else whole / 4).astype(np.float32)
    sums = DiagonalSums(similarity)
    for length in range(1, min(shape) + 1):
        expected = slow_scores(similarity, length)
        assert diagonal_scores(similarity, length).tolist() == expected
        references, scores = best_diagonals(similarity, length)
        found = list(zip(references.tolist(), scores.tolist(), strict=True))
        assert found == [slow_best(row) for row in expected]
        assert sums.best(length).reference.tolist() == references.tolist()
