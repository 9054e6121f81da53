"""Known datasets: found under a data root, with the truth that belongs to them."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.unit.studies.tiny import write_dataset

from retraverse.datasets.known import (
    find_dataset,
    known_dataset,
    known_datasets,
    open_dataset,
)
from retraverse.errors import DataMissingError, InputError


def test_every_entry_says_whose_it_is() -> None:
    names = [known.name for known in known_datasets()]
    assert len(names) == len(set(names)) == 14
    for known in known_datasets():
        assert known.citation
        assert known.licence
        assert known.tolerance_frames >= 0
    assert known_dataset("nordland").tolerance_frames == 1  # type: ignore[union-attr]
    assert known_dataset("elsewhere") is None


@pytest.mark.parametrize(
    ("name", "n_frames", "tolerance"),
    [
        ("corridor", 111, 2),
        ("stromovka", 101, 2),
        ("gardens_point_thumbnails", 200, 2),
        ("nordland_64x32", 179, 1),
    ],
)
def test_real_ones(shared: Callable[[str], Path], name: str, n_frames: int, tolerance: int) -> None:
    dataset = find_dataset(name, shared(f"data/{name}").parent)
    assert dataset is not None
    assert len(dataset.query()) == len(dataset.reference()) == dataset.truth().n_queries == n_frames
    assert dataset.tolerance_frames == tolerance
    assert not dataset.is_as_in_thesis
    # Frame 50 shows place 50.
    assert dataset.truth().is_correct([50], [50]).all()
    assert not dataset.truth().is_correct([50], [50 + tolerance + 1]).any()


def test_nothing_there(tmp_path: Path) -> None:
    assert find_dataset("corridor", tmp_path) is None
    assert find_dataset("my route", tmp_path / "none") is None
    (tmp_path / "corridor" / "query").mkdir(parents=True)
    assert find_dataset("corridor", tmp_path) is None, "one drive alone is no dataset"


def test_other_names_of_folders_and_the_size_of_the_thesis(tmp_path: Path) -> None:
    write_dataset(tmp_path / "GardensPointWalking", n_frames=3)
    (tmp_path / "GardensPointWalking" / "reference").rename(
        tmp_path / "GardensPointWalking" / "ref"
    )
    dataset = find_dataset("gardens_point_day", tmp_path)
    assert dataset is not None
    assert not dataset.is_as_in_thesis
    assert dataset.known.thesis_sizes == (200, 200)


def test_ones_own_route_by_positions_or_list(tmp_path: Path) -> None:
    folder = write_dataset(tmp_path / "mine", n_frames=4)
    assert find_dataset("mine", tmp_path).tolerance_frames == 2  # type: ignore[union-attr]
    for drive in ("query", "reference"):
        rows = "\n".join(f"{10 * index},0" for index in range(4))
        (folder / drive / "positions.csv").write_text(f"x_m,y_m\n{rows}\n")
    by_position = find_dataset("mine", tmp_path)
    assert by_position is not None
    assert by_position.tolerance_frames == -1
    assert by_position.truth().is_correct([0, 0], [2, 3]).tolist() == [True, False]
    (folder / "ground_truth.json").write_text('{"0": [3], "1": [1], "2": [2], "3": [-1]}')
    listed = find_dataset("mine", tmp_path)
    assert listed is not None
    assert listed.truth().is_correct([0, 0], [3, 0]).tolist() == [True, False]


def test_any_two_drives(tmp_path: Path) -> None:
    folder = write_dataset(tmp_path / "mine", n_frames=6)
    drives = folder / "query", folder / "reference"
    dataset = open_dataset("thin", *drives, every=2, tolerance_frames=0)
    assert dataset.truth().is_correct([1, 1], [1, 2]).tolist() == [True, False]
    with pytest.raises(DataMissingError, match=r"dataset x: .*none does not exist"):
        open_dataset("x", tmp_path / "none", drives[1])
    with pytest.raises(DataMissingError, match=r"positions.csv does not exist"):
        open_dataset("x", *drives, radius_m=5)
    for drive in drives:
        (drive / "positions.csv").write_text("position_m\n0\n1\n")
    with pytest.raises(InputError, match="got 2 rows, expected at least 6"):
        open_dataset("x", *drives, radius_m=5).truth()
    (folder / "short.json").write_text('{"0": [0]}')
    with pytest.raises(InputError):
        open_dataset("x", *drives, truth_file=folder / "short.json").truth()
