import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError
from retraverse.images import Encoder, Frame, Traverse, encode_jpeg
from retraverse.images.quantisation import STANDARD_TABLES, QuantisationTables
from retraverse.studies.measuring.quantisation import (
    STEP_GROUPS,
    TuningPlan,
    fit_bytes,
    margin,
    scaled_groups,
    tune_tables,
)
from retraverse.techniques import technique
from retraverse.types import ImageArray

PLAN = TuningPlan(compression=95, n_probes=4, neighbours=1, far=4, factors=(2.0,))


def route(n: int = 14, seed: int = 0) -> list[ImageArray]:
    """Return views along a wide random panorama, which overlap with their neighbours'."""
    noise = np.random.default_rng(seed).integers(0, 256, (64, 64 + 12 * n, 3), dtype=np.uint8)
    wide = np.asarray(cv2.GaussianBlur(noise, (0, 0), 2), np.float32)
    wide = (wide - wide.min()) * (255 / (wide.max() - wide.min()))
    return [wide[:, 12 * i : 12 * i + 64].astype(np.uint8) for i in range(n)]


def traverse(pictures: list[ImageArray]) -> Traverse:
    frames = tuple(Frame.from_array(picture, index=i) for i, picture in enumerate(pictures))
    return Traverse("route", "route", frames)


def test_the_groups_hold_every_step_once() -> None:
    masks = np.array([mask for _, mask in STEP_GROUPS])
    assert masks.shape[1] == 128
    np.testing.assert_array_equal(masks.sum(axis=0), 1)
    assert len({name for name, _ in STEP_GROUPS}) == len(STEP_GROUPS)


def test_factors_multiply_their_group_alone() -> None:
    factors = np.ones(len(STEP_GROUPS))
    factors[0] = 2
    steps = scaled_groups(STANDARD_TABLES, factors)
    expected = np.array(STANDARD_TABLES.luminance + STANDARD_TABLES.chrominance, float)
    expected[0] *= 2
    np.testing.assert_array_equal(steps, expected)


@pytest.mark.parametrize("c", [80, 95])
def test_fitting_meets_the_bytes_from_below(c: int) -> None:
    pictures = route(4)
    wanted = np.mean([len(encode_jpeg(one, c)) for one in pictures])
    steps = np.full(128, 30.0)
    tables, taken = fit_bytes(pictures, steps, float(wanted), Encoder())
    written = [len(encode_jpeg(one, 50, Encoder(tables=tables))) for one in pictures]
    assert taken == np.mean(written) <= wanted
    assert taken > 0.93 * wanted


def test_bytes_no_table_reaches_give_the_coarsest() -> None:
    tables, taken = fit_bytes(route(2), np.full(128, 16.0), 10.0, Encoder())
    assert set(tables.luminance + tables.chrominance) == {255}
    assert taken > 10


def test_margin_counts_neighbours_against_far_places() -> None:
    frames = np.arange(12)
    probes = np.array([2, 9])
    scores = np.tile(np.array([0.1, 0.3] * 6), (2, 1))
    plan = TuningPlan(neighbours=1, far=4)
    expected = []
    for row, probe in enumerate(probes):
        scores[row, [probe - 1, probe + 1]] = 0.8
        scores[row, probe] = 100  # the probe's own picture does not count
        far = scores[row, np.abs(frames - probe) >= 4]
        expected.append((0.8 - far.mean()) / far.std())
    assert margin(scores.astype(np.float32), probes, frames, plan) == pytest.approx(
        np.median(expected), rel=1e-5
    )


@pytest.mark.parametrize("name", ["patchnorm", "hog"])
def test_tuning_does_not_lose_margin_and_keeps_the_bytes(name: str) -> None:
    parameters = {"form": "chapter7", "resolution": 64} if name == "hog" else {}
    found = tune_tables(traverse(route()), technique(name, **parameters), PLAN)
    assert found.n_bytes <= found.n_bytes_standard
    # Trials fit the bytes of fewer probes, so the last fit may cost a little of the margin.
    assert found.margin >= 0.97 * found.margin_standard
    assert found.n_trials == 1 + 2 * len(STEP_GROUPS)
    assert found.tables.name == f"{name}-c95"
    assert isinstance(found.tables, QuantisationTables)


def test_grey_drives_are_tuned_too() -> None:
    grey = traverse([picture[..., 1].copy() for picture in route()])
    found = tune_tables(grey, technique("sad"), PLAN)
    assert found.n_bytes <= found.n_bytes_standard
    assert found == tune_tables(grey, technique("sad"), PLAN)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"compression": 100}, "compression: got 100"),
        ({"neighbours": 8}, "got neighbours 8 and far 8"),
        ({"neighbours": 0}, "got neighbours 0"),
        ({"factors": (0.5,)}, "factors above 1"),
        ({"n_probes": 1}, "at least 2 probes"),
    ],
)
def test_plans_that_are_none(options: dict[str, object], reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        TuningPlan(**options)  # type: ignore[arg-type]


def test_a_drive_too_short() -> None:
    with pytest.raises(InputError, match="route: got 5 frames, expected more than 5 to tune on"):
        tune_tables(traverse(route(5)), technique("sad"), PLAN)
