"""Records: every field survives Parquet, damage is one line, files are whole or not there."""

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import duckdb
import pytest
from tests.unit.studies.fake_records import make_run

from retraverse.errors import DataMissingError, InputError
from retraverse.studies.keeping.records import (
    PERISHABLE,
    RunRecord,
    read_records,
    record_files,
    write_records,
)


def same(one: RunRecord, other: RunRecord) -> bool:
    """Equality in which NaN equals NaN."""
    return repr(one) == repr(other)


def test_every_field_survives(tmp_path: Path) -> None:
    record = make_run(sequence_length=3, chapter="6", encoder="optimised", resize=256, error="a 'b")
    path = tmp_path / "it's.parquet"
    write_records(path, [record, replace(record, run_id="f" * 64, sequence_lengths=(1, 2))])
    first, second = read_records(path)
    assert same(first, record)
    assert second.sequence_lengths == (1, 2)


def test_missing_numbers_are_nan_again(tmp_path: Path) -> None:
    bare = RunRecord("0" * 64, "s", "d", "t", answer_score=(0.5, math.nan, math.inf))
    write_records(tmp_path / "a.parquet", [bare])
    (back,) = read_records(tmp_path / "a.parquet")
    assert math.isnan(back.accuracy)
    assert back.answer_score[0] == 0.5
    assert all(map(math.isnan, back.answer_score[1:]))


def test_records_of_an_earlier_version_lack_what_came_later(tmp_path: Path) -> None:
    record = make_run(jpeg_part="grid", legible_height=0.1)
    write_records(tmp_path / "new.parquet", [record])
    without = "SELECT * EXCLUDE (jpeg_part, legible_height)"
    duckdb.connect().execute(
        f"COPY ({without} FROM read_parquet('{tmp_path}/new.parquet')) "
        f"TO '{tmp_path}/old.parquet' (FORMAT parquet)"
    )
    (back,) = read_records(tmp_path / "old.parquet")
    assert same(back, replace(record, jpeg_part="", legible_height=math.nan))


def test_words_that_are_no_unicode_and_quotes(tmp_path: Path) -> None:
    nasty = 'line\nbreak "quoted" \' \udcff é \x00 end'
    write_records(tmp_path / "a.parquet", [RunRecord("0" * 64, nasty, "d", "t")])
    (back,) = read_records(tmp_path / "a.parquet")
    assert back.study == nasty.replace("\udcff", "\\udcff")


def test_no_records_at_all(tmp_path: Path) -> None:
    write_records(tmp_path / "a.parquet", [])
    assert read_records(tmp_path / "a.parquet") == ()


def test_folder_is_read_by_name_without_hidden_files(tmp_path: Path) -> None:
    for name, study in (("b", "second"), ("a", "first"), (".c", "hidden")):
        write_records(tmp_path / f"{name}.parquet", [make_run(study=study)])
    assert [record.study for record in read_records(tmp_path)] == ["first", "second"]
    assert [path.name for path in record_files(tmp_path)] == ["a.parquet", "b.parquet"]


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no such file or folder"):
        read_records(tmp_path / "none")


@pytest.mark.parametrize("content", [b"", b"PAR1", b"not parquet at all" * 10])
def test_damaged_file_is_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged") as caught:
        read_records(path)
    assert "\n" not in str(caught.value)


def test_unwritable_place_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write records"):
        write_records(tmp_path / "none" / "a.parquet", [make_run()])
    (tmp_path / "a.parquet").mkdir()
    with pytest.raises(InputError, match="cannot write records"):
        write_records(tmp_path / "a.parquet", [make_run()])
    assert [path.name for path in tmp_path.iterdir()] == ["a.parquet"]


@pytest.mark.parametrize("name", [field.name for field in fields(RunRecord)])
def test_content_hash_covers_all_but_the_perishable(name: str) -> None:
    record = make_run()
    value = getattr(record, name)
    others: dict[type, Callable[[], Any]] = {
        int: lambda: value + 1,
        float: lambda: 0.25 if math.isnan(value) else value + 0.25,
        str: lambda: json.dumps({"other": value}),
        tuple: lambda: (*value, 1),
    }
    other = others[type(value)]()
    changed = replace(record, **{name: other})
    assert (changed.content_hash() == record.content_hash()) == (name in PERISHABLE)


def test_content_hash_ignores_machine_and_date() -> None:
    record = make_run()
    entries = json.loads(record.provenance)
    moved = replace(record, provenance=json.dumps({**entries, "machine": "x", "created": "y"}))
    other = replace(record, provenance=json.dumps({**entries, "query_sha256": "2" * 64}))
    assert moved.content_hash() == record.content_hash() != other.content_hash()


def test_importing_studies_does_not_load_the_database() -> None:
    code = "import retraverse.studies.keeping.records, sys; sys.exit('duckdb' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
