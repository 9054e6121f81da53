"""The 30 parts of AMOSNet and HybridNet, and their measure."""

import numpy as np
import pytest

from retraverse.techniques.sped_technique import N_PARTS, l1_similarity, pyramid_maxima

# Of a 13 x 13 map, the rows and columns that no part but the whole one touches.
SKIPPED = {2: (6, 12), 3: (4, 8, 12), 4: (3, 6, 9, 12)}
FIRST = {1: 0, 2: 1, 3: 5, 4: 14}
"""Level -> number of its first part."""


def test_there_are_thirty_parts() -> None:
    assert N_PARTS == 1 + 4 + 9 + 16 == 30


@pytest.mark.parametrize("level", [2, 3, 4])
def test_a_single_value_is_the_maximum_of_its_part_alone(level: int) -> None:
    seen = {}
    for row in range(13):
        maps = np.zeros((1, 1, 13, 13), np.float32)
        maps[0, 0, row, row] = 5
        maxima = pyramid_maxima(maps)[0, 0]
        assert maxima[0] == 5
        parts = np.flatnonzero(maxima[FIRST[level] : FIRST[level] + level**2])
        seen[row] = parts.tolist()
    # On the diagonal part i of a side is part i * (level + 1) of the level.
    expected, part = {}, 0
    for row in range(13):
        expected[row] = [] if row in SKIPPED[level] else [part * (level + 1)]
        part += row in SKIPPED[level]
    assert seen == expected


def test_parts_of_a_level_go_row_by_row() -> None:
    maps = np.zeros((1, 2, 13, 13), np.float32)
    maps[0, 1, 0, 12 - 1] = 7
    maxima = pyramid_maxima(maps)[0]
    assert not maxima[0].any()
    assert np.flatnonzero(maxima[1]).tolist() == [0, 1 + 1, 5 + 2, 14 + 3]


def test_the_measure_is_one_less_the_differences_over_256_squared() -> None:
    random = np.random.default_rng(1)
    queries, references = (random.uniform(0, 9, (n, 7680)).astype(np.float32) for n in (3, 4))
    references[2] = queries[1]
    found = l1_similarity(queries, references)
    for q in range(3):
        for r in range(4):
            pairs = zip(queries[q], references[r], strict=True)
            total = sum(abs(float(one) - float(other)) for one, other in pairs)
            assert found[q, r] == pytest.approx(1 - total / (256 * 256), abs=1e-5)
    assert found[1, 2] == 1


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(2)
    rows = random.uniform(0, 9, (7, 40)).astype(np.float32)
    whole = l1_similarity(rows, rows)
    monkeypatch.setattr("retraverse.techniques.sped_technique._BLOCK_VALUES", 90)
    np.testing.assert_array_equal(l1_similarity(rows, rows), whole)


def test_no_descriptor_is_like_nothing() -> None:
    rows = np.ones((2, 4), np.float32)
    rows[1] = 0
    assert l1_similarity(rows, rows).tolist() == [[1, 0], [0, 0]]
