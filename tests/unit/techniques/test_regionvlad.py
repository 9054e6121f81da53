"""RegionVLAD's vocabulary, built on simulated pictures."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from tests.unit.techniques.seeded_weights import seeded_parameters

import retraverse as rt
from retraverse.datasets.simulated import Camera, simulate_route
from retraverse.errors import DataMissingError, InputError
from retraverse.images import Traverse
from retraverse.techniques import Descriptions
from retraverse.techniques.regionvlad import RegionVlad, RegionVladParameters, build_vocabulary

N_FRAMES = 3


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(seeded_parameters("regionvlad", tmp_path_factory.mktemp("w"))["weights"])


@pytest.fixture(scope="module")
def street() -> Traverse:
    route = simulate_route(3, N_FRAMES, camera=Camera(width=96, height=72, supersampling=1))
    return rt.open_traverse(list(route.reference))


def region_vlad(weights: str, vocabulary: Path | str = "none", words: int = 6) -> RegionVlad:
    return RegionVlad(
        RegionVladParameters(weights=weights, vocabulary=str(vocabulary), words=words, regions=200)
    )


def test_a_vocabulary_of_ones_own_pictures(weights: str, street: Traverse, tmp_path: Path) -> None:
    path = build_vocabulary(
        street, tmp_path / "words.safetensors", technique=region_vlad(weights), most_features=300
    )
    assert load_file(path)["centres"].shape == (6, 384)
    technique = region_vlad(weights, path)
    described = Descriptions.stack(
        technique.describe_batch([frame.colour() for frame in street]), technique.layout
    )
    assert described.descriptor.shape == (N_FRAMES, 6 * 384)
    scores = technique.similarity(described, described)
    assert (scores.argmax(axis=1) == np.arange(N_FRAMES)).all()
    np.testing.assert_allclose(np.diag(scores), 1, atol=1e-5)


def test_the_same_seed_gives_the_same_file(weights: str, street: Traverse, tmp_path: Path) -> None:
    few, technique = list(street)[:2], region_vlad(weights)
    written = [
        build_vocabulary(
            few, tmp_path / f"{run}.safetensors", technique=technique, most_features=200, seed=seed
        ).read_bytes()
        for run, seed in enumerate((0, 0, 1))
    ]
    assert written[0] == written[1]
    assert written[0] != written[2]


def test_too_few_pictures_leave_no_file(weights: str, street: Traverse, tmp_path: Path) -> None:
    technique = region_vlad(weights, words=300)
    with pytest.raises(InputError, match=r"\d+ different features in all, expected at least 300"):
        build_vocabulary(list(street)[:1], tmp_path / "words.safetensors", technique=technique)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_said_first(weights: str, tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="does not exist"):
        build_vocabulary([], tmp_path / "no" / "words.safetensors", technique=region_vlad(weights))


def test_a_missing_vocabulary_says_how_to_build_one(weights: str) -> None:
    technique = region_vlad(weights)
    for ask in (technique.vocabulary, technique.fingerprint):
        with pytest.raises(
            DataMissingError, match="retraverse train regionvlad DRIVE --out"
        ) as caught:
            ask()
        assert "\n" not in str(caught.value)


def test_a_vocabulary_of_another_size_is_refused(weights: str, tmp_path: Path) -> None:
    save_file({"centres": np.ones((4, 384), np.float32)}, tmp_path / "words.safetensors")
    with pytest.raises(InputError, match=r"shape \(4, 384\), expected \(6, 384\)"):
        region_vlad(weights, tmp_path / "words.safetensors").vocabulary()


def test_another_vocabulary_is_another_fingerprint(weights: str, tmp_path: Path) -> None:
    prints = set()
    for value in (1, 2):
        path = tmp_path / f"{value}.safetensors"
        save_file({"centres": np.full((6, 384), value, np.float32)}, path)
        prints.add(region_vlad(weights, path).fingerprint())
    assert len(prints) == 2
