"""What holds for any drive driven again: every frame shows the place it is said to show."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import retraverse as rt
from retraverse.datasets import SpeedProfile, plan_resampling

PROFILES = st.builds(
    SpeedProfile,
    kind=st.sampled_from(["forward", "backwards", "detour", "jump"]),
    speed_change=st.floats(0, 1),
    stops=st.floats(0, 1),
)


@given(
    n_frames=st.integers(10, 300),
    profile=PROFILES,
    spacing=st.floats(0.3, 30),
    seed=st.integers(0, 999),
    tolerance=st.integers(0, 5),
)
def test_truth_follows_the_frames(
    n_frames: int, profile: SpeedProfile, spacing: float, seed: int, tolerance: int
) -> None:
    resampling = plan_resampling(n_frames, profile, spacing=spacing, seed=seed)
    assert len(resampling) >= 1
    assert np.abs(resampling.places - resampling.frames).max() <= 1
    assert 0 <= resampling.frames.min() <= resampling.frames.max() < n_frames
    whole = rt.aligned(n_frames, n_frames, tolerance)
    kept, truth = resampling.map_frames(whole), resampling.truth(whole)
    hidden = resampling.off_map
    assert len(hidden) < n_frames / 2
    assert not truth.has_match()[~resampling.on_map].any()
    for query, frame in enumerate(resampling.frames):
        np.testing.assert_array_equal(
            truth.positives[query], np.flatnonzero(np.abs(kept - frame) <= tolerance)
        )


@given(n_frames=st.integers(10, 300), profile=PROFILES, seed=st.integers(0, 999))
def test_a_leg_is_driven_within_twice_and_half_the_maps_speed(
    n_frames: int, profile: SpeedProfile, seed: int
) -> None:
    steps = np.abs(np.diff(plan_resampling(n_frames, profile, seed=seed).places))
    jumps = steps > 2**profile.speed_change + 1e-9
    slow = (steps < 2**-profile.speed_change - 1e-9) & (steps > 1e-9)
    # Between legs the camera is somewhere else: twice at the most.
    assert jumps.sum() + slow.sum() <= 2
