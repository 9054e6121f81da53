import numpy as np
import pytest
from tests.unit.matching.streets import street

import retraverse as rt
from retraverse.matching.self_similarity import sample_map


@pytest.mark.parametrize(("n_frames", "wanted"), [(1, 8), (5, 8), (8, 8), (9, 8), (50, 8), (50, 1)])
def test_frames_are_spread_over_the_whole_map(n_frames: int, wanted: int) -> None:
    route = rt.build_map(rt.open_traverse(street(n_frames)), rt.technique("hog", resolution=32))
    sample = sample_map(route, wanted)
    assert len(sample.rows) == len(sample.descriptions) == min(wanted, n_frames)
    assert sample.rows[0] == 0
    assert (np.diff(sample.rows) > 0).all()
    if wanted > 1:
        assert sample.rows[-1] == n_frames - 1
        gaps = np.diff(sample.rows)
        assert gaps.size == 0 or gaps.max() - gaps.min() <= 1
    np.testing.assert_array_equal(
        sample.descriptions.descriptor, route.descriptions().descriptor[sample.rows]
    )


@pytest.mark.parametrize(("n_frames", "distance"), [(300, 25), (75, 25), (60, 20), (2, 1)])
def test_far_is_a_third_of_a_short_map(n_frames: int, distance: int) -> None:
    route = rt.build_map(rt.open_traverse(street(n_frames)), rt.technique("hog", resolution=32))
    assert sample_map(route, 4).far_distance(25) == distance
