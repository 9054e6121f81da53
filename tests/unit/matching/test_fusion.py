"""Each mode by hand, and what fusing refuses."""

import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.matching import FusionMode, fuse, uniqueness
from retraverse.types import FloatArray

Rows = list[list[float]]


def array(rows: Rows) -> FloatArray:
    return np.array(rows, np.float32)


def test_sum_by_hand() -> None:
    # Means 2 and 20, standard deviations sqrt(2/3) and 10 * sqrt(2/3).
    fused = fuse([array([[1, 2, 3]]), array([[30, 20, 10]])])
    np.testing.assert_allclose(fused, [[0, 0, 0]], atol=1e-7)
    fused = fuse([array([[1, 2, 3]]), array([[10, 20, 30]])])
    np.testing.assert_allclose(fused, [[-(1.5**0.5), 0, 1.5**0.5]], rtol=1e-6)


def test_rank_by_hand_with_equals() -> None:
    fused = fuse([array([[5, 1, 5, 9]]), array([[0.1, 0.2, 0.3, 0.4]])], "rank")
    np.testing.assert_allclose(fused, [[(0.5 + 0) / 2, (0 + 1 / 3) / 2, (0.5 + 2 / 3) / 2, 1]])


def test_switch_takes_the_surest_for_each_query() -> None:
    sure = np.zeros((1, 30), np.float32)
    sure[0, 20] = 1
    torn = np.zeros((1, 30), np.float32)
    torn[0, [3, 12]] = 1, 0.95
    both = [np.concatenate([sure, torn]), np.concatenate([torn, np.roll(sure, -15)])]
    fused = fuse(both, "switch")
    np.testing.assert_array_equal(fused.argmax(axis=1), [20, 5])
    assert fused[0].std() == pytest.approx(1)


def test_balance_takes_the_hubs_advantage() -> None:
    # Reference 0 is a little more like every query than the right one, on the diagonal.
    similarity = array([[0.8, 0.1, 0.2], [0.8, 0.7, 0.1], [0.8, 0.2, 0.7]])
    assert fuse([similarity]).argmax(axis=1).tolist() == [0, 0, 0]
    assert fuse([similarity], "balanced").argmax(axis=1).tolist() == [0, 1, 2]


@pytest.mark.parametrize("mode", ["sum", "rank", "balanced"])
def test_a_technique_without_an_opinion_does_not_matter(mode: FusionMode) -> None:
    random = np.random.default_rng(0)
    similarity = random.random((6, 9)).astype(np.float32)
    silent = np.full((6, 9), 0.3, np.float32)
    fused, alone = fuse([similarity, silent], mode), fuse([similarity], mode)
    np.testing.assert_array_equal(fused.argsort(axis=1), alone.argsort(axis=1))


def test_uniqueness_by_hand() -> None:
    row = np.zeros(20)
    row[[4, 9, 10]] = 4, 3, 1
    expected = (4 - 1) / row.std()  # 9 is within 5 of the best
    assert uniqueness(row[np.newaxis].astype(np.float32))[0] == pytest.approx(expected)
    nearer = uniqueness(row[np.newaxis].astype(np.float32), excluded=4)[0]
    assert nearer == pytest.approx((4 - 3) / row.std())


def test_a_map_of_one_place_has_no_elsewhere() -> None:
    assert uniqueness(array([[1, 2, 3]]))[0] == 0
    assert fuse([array([[0.4]]), array([[0.2]])], "switch").shape == (1, 1)


GOOD = array([[1, 2], [3, 4]])


@pytest.mark.parametrize(
    ("matrices", "mode", "error", "says"),
    [
        ([], "sum", InputError, "no similarity matrix"),
        ([GOOD], "vote", ConfigError, "sum, rank, switch, balanced"),
        ([GOOD, GOOD[:1]], "sum", ShapeError, r"similarities\[1\]: got shape \(1, 2\)"),
        ([GOOD[0]], "sum", ShapeError, "queries, references"),
        ([GOOD[:, :0]], "sum", ShapeError, "at least one reference"),
        ([GOOD, GOOD * np.nan], "rank", ShapeError, r"similarities\[1\]: holds NaN"),
        ([GOOD[:1]], "balanced", InputError, "at least 2"),
    ],
)
def test_bad_input(
    matrices: list[FloatArray], mode: str, error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        fuse(matrices, mode)  # type: ignore[arg-type]


def test_no_queries_give_no_rows() -> None:
    for mode in ("sum", "rank", "switch"):
        assert fuse([GOOD[:0], GOOD[:0]], mode).shape == (0, 2)
