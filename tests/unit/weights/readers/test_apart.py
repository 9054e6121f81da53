"""What a parser does to its own process is one line here."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers import bad_parsers

from retraverse.errors import InputError
from retraverse.weights.readers import apart

MODULE = bad_parsers.__name__


def saying(folder: Path, what: str) -> Path:
    path = folder / "weights.h5"
    path.write_text(what)
    return path


def test_what_was_read_comes_over(tmp_path: Path) -> None:
    for word in ("", "print"):
        weights = apart.read_apart(MODULE, saying(tmp_path, word), "a test")
        np.testing.assert_array_equal(weights.tensors["a"], [0.0, 1, 2])
        assert (weights.metadata, weights.format) == ({"said": "yes"}, "bad")


def test_a_parser_that_never_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "LONGEST_S", 0.5)
    path = saying(tmp_path, "never end")
    with pytest.raises(InputError, match=f"cannot read {path} as a test: .* not ended after 0.5 s"):
        apart.read_apart(MODULE, path, "a test")


def test_a_parser_that_crashes(tmp_path: Path) -> None:
    path = saying(tmp_path, "crash")
    with pytest.raises(InputError, match=f"cannot read {path} as a test: its parser crashed"):
        apart.read_apart(MODULE, path, "a test")


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    apart.read_apart(MODULE, saying(tmp_path, ""), "a test")
    assert list((tmp_path / "tmp").iterdir()) == []
