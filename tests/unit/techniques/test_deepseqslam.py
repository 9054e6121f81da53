"""DeepSeqSLAM as a technique: what it makes of two drives."""

import numpy as np
import pytest
import torch
from safetensors.numpy import save_file

import retraverse as rt
from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.techniques import Descriptions
from retraverse.techniques.deepseqslam import DeepSeqSlam, DeepSeqSlamParameters, frame_positions
from retraverse.techniques.networks.deepseqslam import (
    DeepSeqSlamNet,
    window_positions,
    windows,
)
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.types import FloatArray, ImageArray

N_FRAMES, LENGTH = 14, 4
CNN = "hog(form=chapter7, resolution=64)"


def street(offset: float = 0.0) -> list[ImageArray]:
    """Return a drive of smooth random pictures; `offset` frames further on is another one."""
    random = np.random.default_rng(5)
    waves, phases = random.uniform(0.5, 2.5, (4, 4, 3)), random.uniform(0, 6, (4, 4, 3))
    coarse = [127 + 120 * np.sin(waves * (n + offset) + phases) for n in range(N_FRAMES)]
    return [one.astype(np.uint8).repeat(8, axis=0).repeat(8, axis=1) for one in coarse]


def described(technique: DeepSeqSlam, images: list[ImageArray]) -> Descriptions:
    frames = rt.open_traverse(images)
    pixels = [technique.read(frame) for frame in frames]
    return Descriptions.stack(technique.describe_batch(pixels), technique.layout)


def trained(descriptors: FloatArray, steps: int = 120) -> DeepSeqSlamNet:
    """Return a network that has learned the drive."""
    torch.manual_seed(0)
    network = DeepSeqSlamNet(descriptors.shape[1], N_FRAMES - LENGTH + 1, LENGTH, hidden=32)
    seen = torch.from_numpy(windows(descriptors.astype(np.float32), LENGTH))
    where = torch.from_numpy(window_positions(frame_positions(N_FRAMES), LENGTH, "relative"))
    optimiser = torch.optim.Adam(network.parameters(), 0.02)
    for _ in range(steps):
        optimiser.zero_grad()
        loss = torch.nn.functional.cross_entropy(network(seen, where), torch.arange(len(seen)))
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    return network


@pytest.fixture(scope="module")
def technique(tmp_path_factory: pytest.TempPathFactory) -> DeepSeqSlam:
    path = tmp_path_factory.mktemp("deepseqslam") / "street.safetensors"
    made = DeepSeqSlam(DeepSeqSlamParameters(weights=str(path), cnn=CNN))
    with torch_threads(1):
        network = trained(described(made, street()).descriptor)
    save_file({name: value.numpy() for name, value in network.state_dict().items()}, path)
    return made


def test_it_knows_the_drive_it_learned(technique: DeepSeqSlam) -> None:
    reference = described(technique, street())
    scores = technique.similarity(described(technique, street(0.1)), reference)
    assert scores.shape == (N_FRAMES, N_FRAMES)
    assert (scores.argmax(axis=1) == np.arange(N_FRAMES)).all()
    n_windows = N_FRAMES - LENGTH + 1
    np.testing.assert_allclose(scores[:n_windows, :n_windows].sum(axis=1), 1, atol=1e-5)
    assert not scores[:n_windows, n_windows:].any()


def test_rows_after_the_last_window_continue_it(technique: DeepSeqSlam) -> None:
    drive = described(technique, street())
    scores = technique.similarity(drive, drive)
    last = N_FRAMES - LENGTH
    for after in range(1, LENGTH):
        np.testing.assert_array_equal(
            scores[last + after, after:], scores[last, : N_FRAMES - after]
        )
        assert not scores[last + after, :after].any()


def test_a_map_answers_through_it(technique: DeepSeqSlam) -> None:
    route = rt.build_map(rt.open_traverse(street()), technique)
    query = rt.open_traverse(street(0.1)[3:12])
    scores = rt.similarity(query, route)
    found = rt.match_similarity(scores, sequence_length=1)
    assert found.reference.tolist() == list(range(3, 12))


def test_a_longer_drive_is_compared_whole(
    technique: DeepSeqSlam, monkeypatch: pytest.MonkeyPatch
) -> None:
    route = rt.build_map(rt.open_traverse(street()), technique)
    query = rt.open_traverse(street(0.1))
    whole = rt.similarity(query, route)
    monkeypatch.setattr("retraverse.matching.pairwise.BLOCK_QUERIES", 3)
    monkeypatch.setattr("retraverse.matching.pairwise.BLOCK_BYTES", 64)
    np.testing.assert_array_equal(rt.similarity(query, route), whole)


def test_fewer_frames_than_a_window_are_one_short_window(technique: DeepSeqSlam) -> None:
    drive = described(technique, street())
    scores = technique.similarity(drive[:2], drive)
    assert scores.shape == (2, N_FRAMES)
    np.testing.assert_array_equal(scores[1, 1:], scores[0, :-1])


def test_real_positions_are_taken(technique: DeepSeqSlam) -> None:
    drive = described(technique, street()).descriptor
    counted = technique.window_scores(drive, frame_positions(N_FRAMES))
    metres = technique.window_scores(drive, 0.7 * frame_positions(N_FRAMES) + 100)
    np.testing.assert_allclose(counted, metres, atol=1e-5)
    standing = frame_positions(N_FRAMES) * (np.arange(N_FRAMES) < 6)[:, np.newaxis]
    assert np.abs(technique.window_scores(drive, standing) - counted).max() > 1e-4


def test_another_map_is_refused(technique: DeepSeqSlam) -> None:
    drive = described(technique, street())
    with pytest.raises(InputError, match="a drive of 14 frames, the map has 13; train it on this"):
        technique.similarity(drive, drive[:13])


def test_other_descriptors_and_positions_are_refused(technique: DeepSeqSlam) -> None:
    with pytest.raises(ShapeError, match="trained on another cnn"):
        technique.window_scores(np.zeros((5, 3), np.float32), frame_positions(5))
    drive = described(technique, street()).descriptor
    with pytest.raises(ShapeError, match=r"expected \(14, 2\)"):
        technique.window_scores(drive, frame_positions(5))


def test_the_cnn_is_any_global_technique() -> None:
    made = rt.technique("deepseqslam", cnn="hog(form=chapter7, resolution=64)")
    assert made.layout.dimension == 144
    with pytest.raises(ConfigError, match="describes regions, expected one vector"):
        rt.technique("deepseqslam", cnn="cohog")
    with pytest.raises(ConfigError, match="expected a technique, perhaps with"):
        rt.technique("deepseqslam", cnn="hog(")
    with pytest.raises(ConfigError, match="did you mean 'hog'"):
        rt.technique("deepseqslam", cnn="hogg")
