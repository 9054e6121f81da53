"""Each profile drives as its name says, and the truth follows."""

import numpy as np
import pytest

import retraverse as rt
from retraverse.datasets import PROFILES, Resampling, SpeedProfile, plan_resampling, resample
from retraverse.errors import ConfigError, InputError

N = 200


@pytest.fixture(scope="module")
def traverse() -> rt.Traverse:
    return rt.open_traverse([np.full((8, 8), i, np.uint8) for i in range(N)])


def check_truth(resampling: Resampling, tolerance: int) -> None:
    """Hold the new truth against the rule itself: within `tolerance` of the frame shown."""
    whole = rt.aligned(N, N, tolerance)
    kept = resampling.map_frames(whole)
    truth = resampling.truth(whole)
    assert truth.n_queries == len(resampling)
    assert truth.n_references == len(kept)
    for query, frame in enumerate(resampling.frames):
        near = np.flatnonzero(np.abs(kept - frame) <= tolerance)
        np.testing.assert_array_equal(truth.positives[query], near)


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("seed", [0, 7])
def test_frames_places_and_truth_agree(traverse: rt.Traverse, name: str, seed: int) -> None:
    driven, resampling = resample(traverse, name, seed=seed)
    np.testing.assert_array_equal(driven.indices, resampling.frames)
    assert driven[5].grey()[0, 0] == resampling.frames[5]
    assert np.abs(resampling.places - resampling.frames).max() <= 1
    assert resampling.frames.min() >= 0
    assert resampling.frames.max() < N
    assert f"seed {seed}" in driven.source
    check_truth(resampling, tolerance=2)
    again = plan_resampling(N, name, seed=seed)
    np.testing.assert_array_equal(again.places, resampling.places)


def test_constant_is_the_drive_itself() -> None:
    resampling = plan_resampling(N, "constant")
    np.testing.assert_array_equal(resampling.frames, np.arange(N))
    truth = rt.aligned(N, N, 2)
    same = resampling.truth(truth)
    assert all(np.array_equal(a, b) for a, b in zip(same.positives, truth.positives, strict=True))
    assert resampling.on_map.all()


def test_backwards_is_the_drive_in_reverse() -> None:
    frames = plan_resampling(N, "backwards").frames
    np.testing.assert_array_equal(frames, np.arange(N)[::-1])


def test_speed_varies_between_half_and_twice_the_maps() -> None:
    steps = np.diff(plan_resampling(2000, "varying", seed=3).places)
    assert steps.min() >= 0.5
    assert steps.max() <= 2
    assert steps.min() < 0.6
    assert steps.max() > 1.8


def test_one_frame_in_three_stands() -> None:
    resampling = plan_resampling(N, "stops", seed=3)
    standing = np.diff(resampling.places) == 0
    assert standing.sum() == pytest.approx(len(resampling) / 3, abs=2)
    np.testing.assert_array_equal(np.unique(resampling.frames), np.arange(N))


def test_a_jump_leaves_no_frame_out() -> None:
    frames = plan_resampling(N, "jump", seed=3).frames
    np.testing.assert_array_equal(np.sort(frames), np.arange(N))
    assert (np.diff(frames) != 1).sum() == 2


def test_a_detour_has_no_match_and_comes_back() -> None:
    resampling = plan_resampling(N, "detour", seed=3)
    whole = rt.aligned(N, N, 2)
    truth = resampling.truth(whole)
    assert len(resampling.off_map) == pytest.approx(N / 5, abs=1)
    assert not truth.has_match()[~resampling.on_map].any()
    assert truth.has_match()[resampling.on_map].all()
    assert resampling.on_map[[0, -1]].all()
    # References within the tolerance of the stretch go too, or its ends would have a match.
    assert truth.n_references == N - len(resampling.off_map) - 4


def test_a_thinned_map_keeps_its_tolerance_in_recorded_frames() -> None:
    """Every 20th recorded frame is on the map; the drive goes at its speed and 20 times finer."""
    n_recorded = 2000
    whole = rt.aligned(n_recorded, n_recorded, 20).select(None, np.arange(0, n_recorded, 20))
    resampling = plan_resampling(n_recorded, SpeedProfile(speed_change=1), spacing=20, seed=1)
    truth = resampling.truth(whole)
    steps = np.diff(resampling.places)
    assert 10 <= steps.min() <= steps.max() <= 40
    assert len(np.unique(resampling.frames % 20)) > 5
    for query, frame in enumerate(resampling.frames):
        near = np.flatnonzero(np.abs(20 * np.arange(100) - frame) <= 20)
        np.testing.assert_array_equal(truth.positives[query], near)


def test_profiles_combine() -> None:
    profile = SpeedProfile("backwards", speed_change=0.5, stops=0.5)
    places = plan_resampling(N, profile, seed=2).places
    steps = np.diff(places)
    assert (steps <= 0).all()
    assert (steps == 0).any()
    assert np.abs(steps).max() <= 2**0.5


@pytest.mark.parametrize(
    ("n_frames", "profile", "spacing", "error", "says"),
    [
        (9, "constant", 1.0, InputError, "at least 10"),
        (N, "sideways", 1.0, ConfigError, "constant, varying, stops"),
        (N, "constant", 0.0, ConfigError, "above 0"),
    ],
)
def test_bad_input(
    n_frames: int, profile: str, spacing: float, error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        plan_resampling(n_frames, profile, spacing=spacing)


@pytest.mark.parametrize(
    "values", [{"kind": "sideways"}, {"speed_change": 1.5}, {"stops": float("nan")}]
)
def test_bad_profiles(values: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        SpeedProfile(**values)  # type: ignore[arg-type]


def test_the_truth_must_be_of_the_recorded_drive() -> None:
    with pytest.raises(InputError, match="before it is resampled"):
        plan_resampling(N, "stops").truth(rt.aligned(N + 1, N, 2))
