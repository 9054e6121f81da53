"""What holds for any similarity matrices: order, scale and offset of techniques do not matter."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from retraverse.matching import FusionMode, fuse, uniqueness
from retraverse.types import FloatArray

MODES: tuple[FusionMode, ...] = get_args(FusionMode)


@st.composite
def matrices(draw: st.DrawFn) -> list[FloatArray]:
    """Return one to four matrices of multiples of 1/64: exact under the scales used below."""
    n_techniques = draw(st.integers(1, 4))
    shape = draw(st.tuples(st.integers(2, 6), st.integers(1, 20)))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.sampled_from([2, 16, 4096]))
    return [
        (random.integers(0, levels, shape) / 64).astype(np.float32) for _ in range(n_techniques)
    ]


def decided(drawn: list[FloatArray]) -> bool:
    """Whether no two techniques are equally sure of a query, so that ``switch`` has one answer."""
    sureness = np.sort([uniqueness(matrix) for matrix in drawn], axis=0)
    return bool((np.diff(sureness, axis=0) > 1e-9).all())


@pytest.mark.parametrize("mode", MODES)
@given(drawn=matrices(), seed=st.integers(0, 99))
def test_the_order_of_techniques_does_not_matter(
    mode: FusionMode, drawn: list[FloatArray], seed: int
) -> None:
    assume(mode != "switch" or decided(drawn))
    order = np.random.default_rng(seed).permutation(len(drawn))
    np.testing.assert_array_equal(fuse([drawn[i] for i in order], mode), fuse(drawn, mode))


@pytest.mark.parametrize("mode", MODES)
@given(
    drawn=matrices(),
    factors=st.lists(st.sampled_from([0.25, 0.5, 2.0, 8.0]), min_size=4, max_size=4),
    offsets=st.lists(st.integers(-16, 16), min_size=4, max_size=4),
)
def test_scale_and_offset_of_a_technique_do_not_matter(
    mode: FusionMode, drawn: list[FloatArray], factors: list[float], offsets: list[int]
) -> None:
    assume(mode != "switch" or decided(drawn))
    rescaled = [
        np.asarray(matrix * factor + offset, np.float32)
        for matrix, factor, offset in zip(drawn, factors, offsets, strict=False)
    ]
    np.testing.assert_allclose(fuse(rescaled, mode), fuse(drawn, mode), atol=1e-4)


@pytest.mark.parametrize("mode", ["sum", "rank", "switch"])
@given(drawn=matrices())
def test_one_technique_keeps_its_ranking(mode: FusionMode, drawn: list[FloatArray]) -> None:
    alone = drawn[0].astype(np.float64)
    fused = fuse(drawn[:1], mode).astype(np.float64)
    before = np.sign(alone[:, :, np.newaxis] - alone[:, np.newaxis])
    after = np.sign(fused[:, :, np.newaxis] - fused[:, np.newaxis])
    np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("mode", ["sum", "rank", "switch"])
@given(drawn=matrices())
def test_each_query_is_fused_by_itself(mode: FusionMode, drawn: list[FloatArray]) -> None:
    rows = [fuse([matrix[i : i + 1] for matrix in drawn], mode) for i in range(len(drawn[0]))]
    np.testing.assert_array_equal(np.concatenate(rows), fuse(drawn, mode))


# `switch` looks at the neighbours of the best reference, which a permutation scatters.
@pytest.mark.parametrize("mode", ["sum", "rank", "balanced"])
@given(drawn=matrices(), seed=st.integers(0, 99))
def test_permuted_references_permute_the_result(
    mode: FusionMode, drawn: list[FloatArray], seed: int
) -> None:
    order = np.random.default_rng(seed).permutation(drawn[0].shape[1])
    fused = fuse([matrix[:, order] for matrix in drawn], mode)
    np.testing.assert_allclose(fused, fuse(drawn, mode)[:, order], atol=1e-4)
