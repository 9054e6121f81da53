import math

import pytest

from retraverse.errors import InputError
from retraverse.metrics import data_volume, performance_per_compute_unit, t_total, t_vpr


def test_the_slowest_technique_scores_its_precision() -> None:
    assert performance_per_compute_unit(0.7, t_e=2.5, t_e_max=2.5) == pytest.approx(0.7)


def test_a_technique_91_times_faster_doubles_its_precision() -> None:
    # log10(91 + 9) = 2
    assert performance_per_compute_unit(0.4, t_e=0.1, t_e_max=9.1) == pytest.approx(0.8)


def test_the_formula_stands_where_t_e_exceeds_t_e_max() -> None:
    value = performance_per_compute_unit(1.0, t_e=10.0, t_e_max=1.0)
    assert value == pytest.approx(math.log10(9.1))
    assert value < 1


@pytest.mark.parametrize(
    ("t_e", "t_m", "sequence_length", "printed"),
    [
        # The thesis, table 4.3: t_e (K frames), t_m and t_VPR as printed, Campus Loop.
        (0.77, 0.049, 1, 0.819),
        (0.432 / 16, 0.21, 16, 0.642),
        (0.36, 0.186, 1, 0.546),
        # Gardens Point (day-to-day).
        (0.27 / 10, 0.622, 10, 0.892),
        (0.36, 0.773, 1, 1.133),
    ],
)
def test_t_vpr_of_the_thesis(t_e: float, t_m: float, sequence_length: int, printed: float) -> None:
    assert t_vpr(t_e, t_m, sequence_length) == pytest.approx(printed, abs=5e-4)


def test_compression_is_paid_once_a_frame() -> None:
    assert t_total(0.5, 0.25, 0.125, 4) == 0.5 * 4 + 0.25 + 0.125 * 4
    assert data_volume(1500, 4) == 6000


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_bad_numbers_are_named(bad: float) -> None:
    with pytest.raises(InputError, match="t_e: got"):
        performance_per_compute_unit(1, t_e=bad, t_e_max=1)
    with pytest.raises(InputError, match="t_e_max: got"):
        performance_per_compute_unit(1, t_e=1, t_e_max=bad)
    with pytest.raises(InputError, match="t_m: got"):
        t_vpr(1, bad)
    with pytest.raises(InputError, match="t_c: got"):
        t_total(1, 1, bad)
    with pytest.raises(InputError, match="sequence_length: got"):
        t_vpr(1, 1, bad)
    with pytest.raises(InputError, match="mean_image_size: got"):
        data_volume(bad)


def test_zero_time_and_percentages_are_refused() -> None:
    with pytest.raises(InputError, match="t_e: got 0"):
        performance_per_compute_unit(1, t_e=0, t_e_max=1)
    with pytest.raises(InputError, match="percentage"):
        performance_per_compute_unit(62.0, t_e=1, t_e_max=1)
