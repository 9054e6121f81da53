import numpy as np
import pytest

from retraverse.datasets import GroundTruth, aligned, from_positions, from_positives
from retraverse.errors import ConfigError, InputError, ShapeError


def lists(truth: GroundTruth) -> list[list[int]]:
    return [listed.tolist() for listed in truth.positives]


def test_aligned_reaches_tolerance_frames_to_both_sides() -> None:
    truth = aligned(4, 5, tolerance=1)
    assert lists(truth) == [[0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 4]]
    assert truth.description == "index-aligned, tolerance 1 frames"
    assert truth.tolerance_frames == 1
    assert truth.n_references == 5
    assert lists(aligned(2, 2, tolerance=0)) == [[0], [1]]


def test_aligned_queries_past_the_map_have_no_match() -> None:
    assert lists(aligned(5, 2, tolerance=1)) == [[0, 1], [0, 1], [1], [], []]


def test_aligned_says_the_tolerance_of_thinned_sets_in_files_too() -> None:
    truth = aligned(3, 3, tolerance=1, every=20)
    assert "tolerance 1 frames (20 files of the original)" in truth.description


@pytest.mark.parametrize("name", ["n_queries", "n_references", "tolerance", "every"])
def test_aligned_bad_numbers(name: str) -> None:
    good = {"n_queries": 1, "n_references": 1, "tolerance": 1, "every": 1}
    with pytest.raises(ConfigError, match=f"{name}: got -1"):
        aligned(**{**good, name: -1})


def test_positions_along_a_line_within_the_radius_inclusive() -> None:
    truth = from_positions([0.0, 100.0, 500.0], [25.0, -25.0, 25.1, 90.0], 25.0)
    assert lists(truth) == [[0, 1], [3], []]
    assert truth.description == "positions within 25 m"
    assert truth.tolerance_frames is None
    assert truth.n_references == 4


def test_positions_on_a_map_far_from_its_origin() -> None:
    # 3-4-5: exactly 25 m away, with the coordinates of UTM.
    utm = np.array([[500_000.0, 6_900_000.0]])
    offsets = np.array([[15, 20], [15, 20.01]])
    assert lists(from_positions(utm, utm + offsets, 25)) == [[0]]


def test_positions_in_space() -> None:
    assert lists(from_positions([[0, 0, 0]], [[2.0, 3.0, 6.0], [2.0, 3.0, 6.1]], 7)) == [[0]]


@pytest.mark.parametrize("seed", range(5))
def test_positions_block_borders_do_not_show(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    random = np.random.default_rng(seed)
    queries, references = random.uniform(0, 50, (23, 2)), random.uniform(0, 50, (17, 2))
    monkeypatch.setattr("retraverse.datasets.truth_sources.BLOCK_PAIRS", 40)
    truth = from_positions(queries, references, 12)
    for query, listed in enumerate(lists(truth)):
        distances = [np.hypot(*(queries[query] - reference)) for reference in references]
        assert listed == [index for index, distance in enumerate(distances) if distance <= 12]


def test_positions_of_nothing() -> None:
    assert lists(from_positions([1.0], np.zeros(0))) == [[]]
    assert from_positions(np.zeros((0, 2)), np.zeros((3, 2))).n_queries == 0


@pytest.mark.parametrize(
    ("queries", "references", "radius", "error", "words"),
    [
        ([[0, 0]], [0], 1, ShapeError, "queries have 2 coordinates, references 1"),
        ([[0, 0, 0, 0]], [0], 1, ShapeError, r"query_positions: got shape \(1, 4\)"),
        ([0], [0, np.nan], 1, InputError, "reference_positions: frame 1 has a position"),
        ([0], [0], -1, ConfigError, "radius_m: got -1"),
        ([0], [0], np.nan, ConfigError, "radius_m: got nan"),
    ],
)
def test_bad_positions(
    queries: list[int], references: list[int], radius: float, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        from_positions(queries, references, radius)


def test_lists_are_sorted_and_each_reference_kept_once() -> None:
    assert lists(from_positives([[3, 1, 3], [], [-1], [-1, -1]])) == [[1, 3], [], [], []]


def test_lists_past_the_map_are_dropped() -> None:
    truth = from_positives([[0, 5], np.array([1], np.uint8)], 2)
    assert lists(truth) == [[0], [1]]
    assert truth.n_dropped == 1


@pytest.mark.parametrize(
    ("positives", "words"),
    [
        ([[0.5]], "query 0: got float64"),
        ([[0], [[1]]], "query 1"),
        ([[-2]], "-2"),
        ([[-1, 4]], "-1"),
    ],
)
def test_bad_lists(positives: list[list[int]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        from_positives(positives)
