"""SeqSLAM and OpenSeqSLAM2 against the published programs, run under Octave on Corridor.

Goldens: openseqslam_octave_corridor.npz (difference matrix D, enhanced DD, matches) and
openseqslam2_octave_corridor.npz (scores, best_score, best_idx_1based, u, offsets qs and rs), both
with references in rows and indices from 1. OpenSeqSLAM2's search ran on the same enhanced matrix.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.matching.matchers.contrast import enhance_contrast
from retraverse.matching.matchers.openseqslam2 import OpenSeqSlam2
from retraverse.matching.matchers.seqslam import SeqSlam
from retraverse.types import FloatArray

Shared = Callable[[str], Path]


@pytest.fixture(scope="module")
def openseqslam(shared: Shared) -> Mapping[str, Any]:
    return dict(np.load(shared("golden/openseqslam_octave_corridor.npz")))


@pytest.fixture(scope="module")
def similarity(openseqslam: Mapping[str, Any]) -> FloatArray:
    return np.ascontiguousarray(-openseqslam["D"].T)


def test_contrast_enhancement(openseqslam: Mapping[str, Any], similarity: FloatArray) -> None:
    enhanced = enhance_contrast(-similarity, radius=5)
    expected = openseqslam["DD"].T
    np.testing.assert_allclose(
        enhanced - enhanced.min(), expected, rtol=1e-5, atol=1e-5 * expected.max()
    )


def test_seqslam(openseqslam: Mapping[str, Any], similarity: FloatArray) -> None:
    matches = rt.match_similarity(
        similarity, sequence_length=10, matcher=rt.matcher("seqslam", index="original")
    )
    index, score = openseqslam["matches"].T
    answered = np.flatnonzero(~np.isnan(index))
    np.testing.assert_array_equal(matches.query, answered)
    np.testing.assert_array_equal(matches.reference + 1, index[answered])
    np.testing.assert_allclose(1 - matches.score, score[answered], atol=1e-4)


def test_openseqslam2(shared: Shared, similarity: FloatArray) -> None:
    golden = np.load(shared("golden/openseqslam2_octave_corridor.npz"))
    lines = OpenSeqSlam2().lines(15)
    np.testing.assert_array_equal(lines.offsets, golden["rs"])
    np.testing.assert_array_equal(np.arange(15) - lines.middle, golden["qs"][0])
    matches = rt.match_similarity(similarity, sequence_length=15, matcher="openseqslam2")
    answered = np.flatnonzero(~np.isnan(golden["best_score"][0]))
    np.testing.assert_array_equal(matches.query, answered)
    np.testing.assert_array_equal(matches.reference + 1, golden["best_idx_1based"][0, answered])
    np.testing.assert_allclose(1 / (1 - matches.score), golden["u"][0, answered], atol=1e-4)
    enhanced = enhance_contrast(-similarity, radius=5)
    found = OpenSeqSlam2().search(enhanced, lines)
    sums = OpenSeqSlam2().distances(found.best, lines, float(enhanced.min()))
    np.testing.assert_allclose(sums, golden["best_score"][0, answered], rtol=1e-5)


def test_slopes_are_the_published_ones() -> None:
    lines = SeqSlam().lines(10)
    expected = [[int(t * v + 1e-9) for t in range(11)] for v in (0.8, 0.9, 1.0, 1.1, 1.2)]
    np.testing.assert_array_equal(lines.offsets, expected)


@pytest.mark.parametrize(("index", "accuracy"), [("original", 0.416), ("slope_aware", 0.515)])
def test_the_slope_aware_index_is_worth_ten_points(
    shared: Shared, similarity: FloatArray, index: str, accuracy: float
) -> None:
    truth = rt.ground_truth(shared("data/corridor/ground_truth.json"))
    matches = rt.match_similarity(similarity, matcher=rt.matcher("seqslam", index=index))
    assert rt.evaluate(matches, truth).accuracy == pytest.approx(accuracy, abs=0.02)


def test_openseqslam2_accuracy_and_uniqueness(shared: Shared, similarity: FloatArray) -> None:
    truth = rt.ground_truth(shared("data/corridor/ground_truth.json"))
    matches = rt.match_similarity(similarity, sequence_length=15, matcher="openseqslam2")
    assert rt.evaluate(matches, truth).accuracy == pytest.approx(0.722, abs=0.005)
    unique = rt.matcher("openseqslam2", uniqueness=0.9)
    kept = rt.match_similarity(similarity, sequence_length=15, matcher=unique)
    assert int(kept.is_match.sum()) == 42
    correct = truth.is_correct(kept.query, kept.reference)[kept.is_match]
    assert correct.mean() == pytest.approx(0.810, abs=0.005)
