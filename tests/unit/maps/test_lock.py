import os
from pathlib import Path

import pytest

from retraverse.errors import MapError
from retraverse.maps.lock import LOCK, locked


def test_the_second_writer_gets_one_line(tmp_path: Path) -> None:
    place = tmp_path / "route.map"
    with locked(tmp_path, place):
        with pytest.raises(MapError) as caught, locked(tmp_path, place):
            pass
        assert str(caught.value) == (
            f"{place}: another process is writing this map; wait until it is done"
        )
    with locked(tmp_path, place) as still_ours:
        assert still_ours()


def test_an_error_inside_frees_the_lock(tmp_path: Path) -> None:
    with pytest.raises(KeyError), locked(tmp_path, tmp_path):
        raise KeyError
    with locked(tmp_path, tmp_path):
        pass


def test_a_folder_that_was_moved_or_made_anew_is_not_ours(tmp_path: Path) -> None:
    folder = tmp_path / "one"
    with locked(folder, folder, create=True) as still_ours:
        folder.rename(tmp_path / "two")
        assert not still_ours()
        with locked(folder, folder, create=True) as theirs:
            assert theirs()
            assert not still_ours()


def test_a_lock_whose_file_was_replaced_meanwhile_is_taken_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    really, calls = os.open, []

    def replaced_after_opening(path: Path, *args: int) -> int:
        opened = really(path, *args)
        calls.append(path)
        if len(calls) == 1:
            path.unlink()
        return opened

    monkeypatch.setattr(os, "open", replaced_after_opening)
    with locked(tmp_path, tmp_path) as still_ours:
        assert still_ours()
    assert len(calls) == 2


def test_the_lock_is_never_a_link(tmp_path: Path) -> None:
    (tmp_path / "victim").write_text("mine")
    (tmp_path / LOCK).symlink_to(tmp_path / "victim")
    with pytest.raises(MapError, match="cannot be locked for writing"), locked(tmp_path, tmp_path):
        pass


def test_a_folder_that_is_not_there_is_not_made_unasked(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="No such file"), locked(tmp_path / "no", tmp_path / "no"):
        pass
    assert not (tmp_path / "no").exists()
