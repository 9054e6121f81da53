"""ConvSequential-SLAM on Corridor against the authors' program.

Goldens: convseqslam_dynamic_corridor.csv (query, reference, score, K, sequential entropy) and
convseqslam_static_k3_corridor.csv (query, reference, score), written by the published Python 2
program with its default parameters. Grey path: "decoder".
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.matching import GrowthRule, describe_query, dynamic_windows
from retraverse.matching.calibrated_length import Overlap
from retraverse.techniques import Descriptions
from retraverse.types import Array

Corridor = tuple[rt.RouteMap, Descriptions]
Shared = Callable[[str], Path]


def golden(path: Path) -> Array:
    return np.array([[float(cell) for cell in row.split(",")] for row in path.read_text().split()])


@pytest.fixture(scope="module")
def corridor(shared: Shared) -> Corridor:
    technique = rt.technique("convsequential", grey="decoder")
    route = rt.build_map(rt.open_traverse(shared("data/corridor/reference")), technique)
    return route, describe_query(rt.open_traverse(shared("data/corridor/query")), route)


def test_dynamic_windows_answers_and_scores(corridor: Corridor, shared: Shared) -> None:
    expected = golden(shared("golden/convseqslam_dynamic_corridor.csv"))
    route, queries = corridor
    matches = rt.match(queries, route, sequence_length="dynamic")
    assert len(expected) == len(matches) == 97
    np.testing.assert_array_equal(matches.query, expected[:, 0])
    np.testing.assert_array_equal(matches.sequence_length, expected[:, 3])
    np.testing.assert_array_equal(matches.reference, expected[:, 1])
    np.testing.assert_allclose(matches.score, expected[:, 2], atol=1e-4)
    assert matches.n_unanswered == 14


def test_sequential_entropy(corridor: Corridor, shared: Shared) -> None:
    expected = golden(shared("golden/convseqslam_dynamic_corridor.csv"))
    route, queries = corridor
    overlap = Overlap(route.technique, queries)
    windows = dynamic_windows(queries.arrays["entropy"], overlap, GrowthRule())
    entropies = [window.sequential_entropy for window in windows]
    np.testing.assert_allclose(entropies, expected[:, 4], atol=1e-5)


def test_static_windows(corridor: Corridor, shared: Shared) -> None:
    expected = golden(shared("golden/convseqslam_static_k3_corridor.csv"))
    route, queries = corridor
    matches = rt.match(queries, route, sequence_length=3)
    np.testing.assert_array_equal(matches.query, expected[:, 0])
    np.testing.assert_array_equal(matches.reference, expected[:, 1])
    np.testing.assert_allclose(matches.score, expected[:, 2], atol=1e-4)
