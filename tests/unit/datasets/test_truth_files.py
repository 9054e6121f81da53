from pathlib import Path

import pytest

from retraverse.datasets import ground_truth
from retraverse.errors import DataMissingError, InputError


def written(folder: Path, text: str) -> Path:
    path = folder / "truth.json"
    path.write_text(text, "utf-8")
    return path


def test_read(tmp_path: Path) -> None:
    path = written(tmp_path, '{"1": [2, 1, 2], "0": [0], "2": [-1], "3": []}')
    truth = ground_truth(path)
    assert [listed.tolist() for listed in truth.positives] == [[0], [1, 2], [], []]
    assert truth.n_references is None
    assert truth.description == "list in truth.json"


def test_read_for_a_map_of_known_size(tmp_path: Path) -> None:
    path = written(tmp_path, '{"0": [0, 1], "1": [2]}')
    truth = ground_truth(str(path), n_references=2)
    assert truth.n_references == 2
    assert truth.n_dropped == 1
    assert truth.has_match().tolist() == [True, False]


def test_read_with_a_byte_order_mark(tmp_path: Path) -> None:
    assert ground_truth(written(tmp_path, '\ufeff{"0": [7]}')).positives[0].tolist() == [7]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not JSON"),
        ('{"0": [1]', "not JSON"),
        ("[[0], [1]]", "got list; expected"),
        ("{}", "got no queries"),
        ('{"0": [1], "2": [3], "5": [0]}', "3 queries are missing, the first is 1"),
        ('{"0": [1], "0": [2]}', "query '0' is there twice"),
        ('{"0": [1], "00": [2]}', "got query '00'"),
        ('{"-1": [1]}', "got query '-1'"),
        ('{"frame": [1]}', "got query 'frame'"),
        ('{"²": [1]}', "got query '²'"),
        ('{"0": 1}', "query 0 has 1, expected a list"),
        ('{"0": [1.0]}', "query 0 has"),
        ('{"0": [true]}', "query 0 has"),
        ('{"0": ["1"]}', "query 0 has"),
        ('{"0": [-2]}', "query 0 has"),
        ('{"0": [-1, 4]}', "query 0 has"),
        ('{"0": null}', "query 0 has None"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        ground_truth(written(tmp_path, text))
    assert "truth.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "picture.json"
    path.write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(InputError, match="not JSON"):
        ground_truth(path)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="does not exist"):
        ground_truth(tmp_path / "nowhere.json")
    with pytest.raises(DataMissingError, match="is a folder"):
        ground_truth(tmp_path)
