"""Files of quantisation tables: there and back, and every way to get one wrong."""

import json
from pathlib import Path
from typing import Any

import pytest

from retraverse.errors import DataMissingError, InputError, RetraverseError
from retraverse.images import QuantisationTables
from retraverse.studies.plans.tables_file import load_tables, save_tables

SOUND = {"luminance": list(range(1, 65)), "chrominance": [99] * 64}


def test_there_and_back(tmp_path: Path) -> None:
    tables = QuantisationTables(tuple(range(1, 65)), (99,) * 64, "tuned-c95")
    save_tables(tmp_path / "tables.json", tables)
    assert load_tables(tmp_path / "tables.json") == tables


def test_the_name_is_the_files_unless_told(tmp_path: Path) -> None:
    (tmp_path / "cohog.json").write_text(json.dumps(SOUND))
    assert load_tables(tmp_path / "cohog.json").name == "cohog"


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[1, 2]", "got list, expected luminance and chrominance"),
        ({**SOUND, "luminanse": []}, "did you mean 'luminance'?"),
        ({"luminance": SOUND["luminance"]}, "chrominance: got nothing, expected a list of 64"),
        ({**SOUND, "luminance": [1.5] * 64}, "luminance: got 1.5, expected whole steps"),
        ({**SOUND, "luminance": [True] * 64}, "luminance: got True, expected whole steps"),
        ({**SOUND, "luminance": [1] * 63}, "luminance table: got 63 steps, expected 64"),
        ({**SOUND, "chrominance": [0] * 64}, "expected whole steps from 1 to 32767"),
        ({**SOUND, "name": 4}, "name: got 4, expected a text"),
        ({**SOUND, "name": "two\nlines"}, "name: got 'two"),
    ],
)
def test_what_can_be_wrong_is_one_line(tmp_path: Path, content: Any, problem: str) -> None:
    path = tmp_path / "tables.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(RetraverseError) as caught:
        load_tables(path)
    assert problem in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match=r"tables\.json: no such file"):
        load_tables(tmp_path / "tables.json")


def test_a_place_that_is_not_there(tmp_path: Path) -> None:
    tables = QuantisationTables((1,) * 64, (1,) * 64)
    with pytest.raises(InputError, match="cannot be written: No such file"):
        save_tables(tmp_path / "nowhere" / "tables.json", tables)
