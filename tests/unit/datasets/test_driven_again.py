"""Datasets driven again: what they are called, which pictures they show, what is true of them."""

from pathlib import Path

import numpy as np
import pytest
from tests.unit.studies.tiny import write_dataset

from retraverse.datasets import PROFILES, plan_resampling
from retraverse.datasets.driven_again import driven_again, find_driven, recorded_name
from retraverse.datasets.known import Dataset, find_dataset
from retraverse.errors import ConfigError, InputError

SPEEDS = [name for name in PROFILES if name != "constant"]
N = 40


@pytest.fixture(scope="module", name="recorded")
def _recorded(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    root = tmp_path_factory.mktemp("data")
    write_dataset(root / "corridor", n_frames=N)
    dataset = find_dataset("corridor", root)
    assert dataset is not None
    return dataset


@pytest.mark.parametrize(
    ("speed", "name"),
    [
        ("varying", "corridor, varying speed"),
        ("stops", "corridor, with stops"),
        ("backwards", "corridor, backwards"),
        ("detour", "corridor, with a detour"),
        ("jump", "corridor, with jumps"),
    ],
)
def test_a_name_says_how_it_is_driven(recorded: Dataset, speed: str, name: str) -> None:
    dataset = driven_again(recorded, speed)
    assert dataset.name == name
    assert dataset.known.title == name.capitalize()
    assert dataset.known.citation == recorded.known.citation
    assert recorded_name(name) == ("corridor", speed)


def test_a_constant_speed_is_the_recorded_drive(recorded: Dataset) -> None:
    assert driven_again(recorded, "constant") is recorded
    assert recorded_name("corridor") == ("corridor", "constant")


@pytest.mark.parametrize("speed", SPEEDS)
def test_pictures_and_truth_belong_together(recorded: Dataset, speed: str) -> None:
    dataset = driven_again(recorded, speed)
    query, reference, truth = dataset.query(), dataset.reference(), dataset.truth()
    np.testing.assert_array_equal(query.indices, plan_resampling(N, speed, seed=0).frames)
    assert (truth.n_queries, truth.n_references) == (len(query), len(reference))
    for shown, positives in zip(query.indices, truth.positives, strict=True):
        near = np.abs(reference.indices - shown) <= 2
        np.testing.assert_array_equal(positives, np.flatnonzero(near))
    assert (len(reference) < N) == (speed == "detour")
    assert dataset.tolerance_frames == 2
    assert not dataset.is_as_in_thesis
    assert "seed 0" in query.source
    contents = [
        (d.query().content_hash(), d.reference().content_hash()) for d in (dataset, recorded)
    ]
    assert contents[0] != contents[1]


def test_seeds_draw_other_drives(recorded: Dataset) -> None:
    first, second = (driven_again(recorded, "varying", seed=seed).query() for seed in (0, 1))
    assert first.indices.tolist() != second.indices.tolist()


def test_by_name_under_a_data_root(tmp_path: Path) -> None:
    write_dataset(tmp_path / "corridor", n_frames=N)
    write_dataset(tmp_path / "mine, with stops", n_frames=12)
    found = find_driven("corridor, with jumps", tmp_path)
    assert found is not None
    np.testing.assert_array_equal(found.query().indices, plan_resampling(N, "jump").frames)
    plain, own = (find_driven(name, tmp_path) for name in ("corridor", "mine, with stops"))
    assert plain is not None
    assert (plain.name, len(plain.query())) == ("corridor", N)
    assert own is not None, "a folder may be called so"
    assert own.query().indices.tolist() == list(range(12))
    assert find_driven("elsewhere, with jumps", tmp_path) is None
    assert find_driven("elsewhere", tmp_path) is None


def test_what_cannot_be_driven_is_said(recorded: Dataset, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"unknown speed: got 'varyin'.*did you mean 'varying'"):
        driven_again(recorded, "varyin")
    write_dataset(tmp_path / "short", n_frames=9)
    short = find_driven("short, backwards", tmp_path)
    assert short is not None
    with pytest.raises(InputError, match="got a drive of 9 frames, expected at least 10"):
        short.query()
