"""Windows against the thesis' algorithms written as plain loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import retraverse as rt
from retraverse.matching import describe_query
from retraverse.matching.windows import match_diagonals
from retraverse.types import Array, FloatArray, IntArray


def algorithms_4_and_5(similarity: Array, K: int) -> list[tuple[int, float]]:
    """Score every pair of windows pair by pair, as printed."""
    answers = []
    for i in range(similarity.shape[0] - K + 1):
        scores = []
        for j in range(similarity.shape[1] - K + 1):
            total = 0.0
            for t in range(K):
                total += float(similarity[i + t, j + t])
            scores.append(total / K)
        answers.append((int(np.argmax(scores)), max(scores)))
    return answers


def random_similarity(seed: int, n_queries: int, n_references: int) -> FloatArray:
    return np.random.default_rng(seed).random((n_queries, n_references), np.float32)


@given(
    seed=st.integers(0, 2**32 - 1),
    n_queries=st.integers(1, 25),
    n_references=st.integers(1, 25),
    K=st.integers(1, 8),
)
def test_match_similarity_is_algorithms_4_and_5(
    seed: int, n_queries: int, n_references: int, K: int
) -> None:
    K = min(K, n_queries, n_references)
    similarity = random_similarity(seed, n_queries, n_references)
    expected = algorithms_4_and_5(similarity, K)
    matches = rt.match_similarity(similarity, sequence_length=K)
    assert matches.reference.tolist() == [reference for reference, _ in expected]
    np.testing.assert_allclose(matches.score, [score for _, score in expected], rtol=1e-6)
    assert (matches.n_queries, matches.n_references) == (n_queries, n_references)
    assert matches.n_unanswered == K - 1


@given(seed=st.integers(0, 2**32 - 1), block=st.integers(1, 12))
def test_blocks_change_nothing(seed: int, block: int) -> None:
    random = np.random.default_rng(seed)
    similarity = random_similarity(seed, 30, 20)
    lengths: IntArray = random.integers(1, 9, 22)
    blocks = [(start, similarity[start : start + block]) for start in range(0, 30, block)]
    whole = match_diagonals([(0, similarity)], lengths)
    for expected, found in zip(whole, match_diagonals(blocks, lengths), strict=True):
        np.testing.assert_array_equal(found, expected)
    for window, length in enumerate(lengths):
        only = algorithms_4_and_5(similarity[window : window + length], int(length))
        assert whole[0][window] == only[0][0]


def region_scores(query: Array, reference: Array, roi: Array) -> float:
    """Follow algorithm 1: the ROI's rows, each region's best, their mean."""
    best = (query.astype(np.float64) @ reference.T.astype(np.float64)).max(axis=1)
    return float(best[roi].mean())


@pytest.mark.parametrize("K", [2, 4, "dynamic"])
@pytest.mark.parametrize("roi", ["first", "each"])
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_regional_windows_by_plain_loops(seed: int, roi: str, K: int | str) -> None:
    random = np.random.default_rng(seed)
    scene = random.integers(0, 256, (64, 300)).astype(np.uint8)
    scene[:, 100:180] //= 16
    frames = [scene[:, 10 * i : 10 * i + 64] for i in range(20)]
    technique = rt.technique("convsequential", resolution=64, roi=roi, roi_entropy=0.6)
    route = rt.build_map(rt.open_traverse(frames), technique)
    noisy = [frame // 2 + random.integers(0, 99, frame.shape).astype(np.uint8) for frame in frames]
    queries = describe_query(rt.open_traverse(noisy), route)
    references = describe_query(rt.open_traverse(frames), route).descriptor
    matches = rt.match(queries, route, sequence_length=K)  # type: ignore[arg-type]
    rois = queries.arrays["region_entropy"] >= np.float32(0.6)
    rois[~rois.any(axis=1)] = True
    assert len(matches) >= 2
    for window in range(len(matches)):
        length = int(matches.sequence_length[window])
        scores = [
            np.mean(
                [
                    region_scores(
                        queries.descriptor[window + t],
                        references[start + t],
                        rois[window if roi == "first" else window + t],
                    )
                    for t in range(length)
                ]
            )
            for start in range(len(frames) - length + 1)
        ]
        assert matches.score[window] == pytest.approx(max(scores), abs=1e-5)
        assert scores[matches.reference[window]] == pytest.approx(max(scores), abs=1e-6)
