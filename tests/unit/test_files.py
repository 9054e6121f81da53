"""Files are whole or not there."""

from pathlib import Path

import pytest

from retraverse.errors import DataMissingError
from retraverse.files import replace_file


def test_writes_an_ordinary_file(tmp_path: Path) -> None:
    with replace_file(tmp_path / "a.txt") as file:
        file.write("whole")
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert (tmp_path / "a.txt").stat().st_mode & 0o400
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_error_leaves_the_old_file(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(type(error)), replace_file(path) as file:
        file.write("half")
        raise error
    assert path.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="does not exist"), replace_file(tmp_path / "x" / "y"):
        raise AssertionError("never opened")
