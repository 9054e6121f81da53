"""Records without their long columns, and with them again."""

from dataclasses import replace
from pathlib import Path

import duckdb
import pytest
from tests.unit.reports.study_report.made_up import make_run, write_study

from retraverse.errors import DataMissingError, InputError
from retraverse.studies.keeping.light_records import (
    LONG_COLUMNS,
    read_light_records,
    study_folders,
    with_long_columns,
)

RUNS = [make_run(chapter="4"), make_run(length="dynamic"), make_run("campus_loop")]


def test_light_records_lack_the_long_columns_alone(tmp_path: Path) -> None:
    write_study(tmp_path, RUNS)
    light = read_light_records([tmp_path])
    for found, run in zip(light, RUNS, strict=True):
        same = {name: value for name, value in vars(run).items() if name not in LONG_COLUMNS}
        assert {name: getattr(found, name) for name in same} == same
        assert found.answer_query == ()
    assert with_long_columns([tmp_path], light[1:]) == tuple(RUNS[1:])


def test_old_records_beside_new_ones_lack_what_came_later(tmp_path: Path) -> None:
    write_study(tmp_path / "new", [replace(RUNS[0], jpeg_part="grid", group_length=8)])
    (new,) = (tmp_path / "new" / "records").glob("*.parquet")
    (tmp_path / "old" / "records").mkdir(parents=True)
    without = f"SELECT * EXCLUDE (jpeg_part, group_length) FROM read_parquet('{new}')"
    old = tmp_path / "old" / "records" / "a.parquet"
    duckdb.connect().execute(f"COPY ({without}) TO '{old}' (FORMAT parquet)")
    (alone,) = read_light_records([tmp_path / "old"])
    assert (alone.jpeg_part, alone.group_length) == ("", 0)
    other = replace(RUNS[1], jpeg_part="grid", group_length=8)
    write_study(tmp_path / "new", [other], part="b")
    mixed = read_light_records([tmp_path / "old", tmp_path / "new"])
    found = {run.run_id: (run.jpeg_part, run.group_length) for run in mixed}
    assert found[other.run_id] == ("grid", 8)
    assert len(found) == 2


def test_a_repeated_run_counts_once_and_its_result_before_its_failure(tmp_path: Path) -> None:
    better = replace(RUNS[0], accuracy=0.75)
    failed = replace(RUNS[0], status="failed", error="no room")
    write_study(tmp_path, [RUNS[0]], part="a")
    write_study(tmp_path, [better], part="b")
    write_study(tmp_path, [failed], part="c")
    (found,) = read_light_records([tmp_path])
    assert (found.accuracy, found.status) == (0.75, "ok")


def test_one_study_or_a_folder_of_several(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no study here"):
        study_folders(tmp_path)
    write_study(tmp_path / "b", RUNS[:1])
    write_study(tmp_path / "a", RUNS[1:])
    assert study_folders(tmp_path) == (tmp_path / "a", tmp_path / "b")
    assert study_folders(tmp_path / "a") == (tmp_path / "a",)
    assert len(read_light_records(study_folders(tmp_path))) == 3


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    write_study(tmp_path, RUNS)
    (tmp_path / "records" / "part-0.parquet").write_bytes(b"PAR1 nonsense")
    with pytest.raises(InputError, match="damaged"):
        read_light_records([tmp_path])


def test_a_study_that_has_just_begun_has_no_records(tmp_path: Path) -> None:
    (tmp_path / "records").mkdir()
    assert read_light_records([tmp_path]) == ()
