"""The projection is the published one: NumPy's legacy numbers, row by row."""

import numpy as np
import pytest

from retraverse.techniques.summarising.random_projection import gaussian_projection

# np.random.seed(0); np.random.randn(): the first numbers, as NumPy's own documentation
# and many a tutorial print them.
FIRST = [1.76405235, 0.40015721, 0.97873798, 2.2408932, 1.86755799, -0.97727788]


def test_it_begins_with_the_known_numbers() -> None:
    np.testing.assert_allclose(gaussian_projection(2, 3).ravel(), FIRST, rtol=1e-6)


@pytest.mark.parametrize("dimension", [1, 5, 8])
def test_it_is_what_the_published_program_draws_at_once(dimension: int) -> None:
    state = np.random.get_state()
    np.random.seed(0)
    expected = np.random.randn(131, dimension).astype(np.float32)
    np.random.set_state(state)
    np.testing.assert_array_equal(gaussian_projection(131, dimension), expected)


def test_a_longer_one_begins_with_a_shorter_one() -> None:
    np.testing.assert_array_equal(gaussian_projection(70, 9)[:3], gaussian_projection(3, 9))
