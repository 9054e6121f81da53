"""What 8-bit descriptors cost on real drives: scores, and answers of dynamic windows.

The promise: scores within 2e-3 of float32; at least 95 % of dynamic windows keep their match;
where one does not, the place it takes instead scores within 1e-3 of the float winner, in float.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.matching import describe_query
from retraverse.techniques import Descriptions, RegionalTechnique

Shared = Callable[[str], Path]
DRIVES = {
    "corridor": ("data/corridor/reference", "data/corridor/query"),
    "stromovka": ("data/stromovka/autumn", "data/stromovka/snow"),
}


def float_score(
    technique: RegionalTechnique,
    queries: Descriptions,
    references: Descriptions,
    window: tuple[int, int],
    reference: int,
) -> float:
    """Score one window at one place, pair by pair, under its first frame's ROI."""
    start, length = window
    weights = technique.region_weights(queries[start : start + 1])
    scores = [
        technique.weighted_similarity(
            queries.descriptor[start + t],
            references.descriptor[reference + t : reference + t + 1],
            weights,
        )[0, 0]
        for t in range(length)
    ]
    return float(np.mean(scores))


@pytest.mark.parametrize("name", DRIVES)
def test_int8_keeps_scores_and_answers(shared: Shared, name: str) -> None:
    reference, query = (rt.open_traverse(shared(folder)) for folder in DRIVES[name])
    routes, described, answers = {}, {}, {}
    for precision in ("float32", "int8"):
        technique = rt.technique("convsequential", precision=precision)
        routes[precision] = rt.build_map(reference, technique)
        described[precision] = describe_query(query, routes[precision])
        answers[precision] = rt.match(
            described[precision], routes[precision], sequence_length="dynamic"
        )
    exact, coarse = answers["float32"], answers["int8"]
    assert len(exact) == len(coarse)
    np.testing.assert_allclose(coarse.score, exact.score, atol=2e-3)
    kept = (exact.reference == coarse.reference) & (exact.sequence_length == coarse.sequence_length)
    print(f"{name}: {kept.mean():.3f} of {len(exact)} windows keep their match")
    assert kept.mean() >= 0.95
    technique = routes["float32"].technique
    assert isinstance(technique, RegionalTechnique)
    for window in np.flatnonzero(~kept):
        instead = float_score(
            technique,
            described["float32"],
            routes["float32"].descriptions(),
            (int(window), int(exact.sequence_length[window])),
            int(coarse.reference[window]),
        )
        assert exact.score[window] - instead <= 1e-3


def test_single_frame_scores(shared: Shared) -> None:
    reference, query = (rt.open_traverse(shared(folder))[:40] for folder in DRIVES["corridor"])
    scores = [
        rt.similarity(query, rt.build_map(reference, rt.technique("cohog", precision=precision)))
        for precision in ("float32", "int8")
    ]
    np.testing.assert_allclose(scores[1], scores[0], atol=2e-3)
