"""Files are whole or not there."""

import os
from pathlib import Path

import pytest

from retraverse.errors import DataMissingError, InputError
from retraverse.files import check_writable_place, write_whole


def test_writes_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    for content in (b"first", b"second"):
        write_whole(path, content)
        assert path.read_bytes() == content
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_error_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def fail(descriptor: int) -> None:
        raise error

    path = tmp_path / "a.txt"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(type(error)):
        write_whole(path, b"half")
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    check_writable_place(tmp_path / "fine.html")
    with pytest.raises(DataMissingError, match="does not exist"):
        check_writable_place(tmp_path / "no" / "where.html")
    with pytest.raises(InputError, match="it is a folder"):
        check_writable_place(tmp_path)
