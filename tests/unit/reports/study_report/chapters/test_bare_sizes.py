"""What constant tables weigh: the table of chapter 6 by numbers one can check by hand."""

import csv
import io
from pathlib import Path

import pytest
from tests.unit.reports.study_report.made_up import make_run, write_study

from retraverse.reports import write_study_report
from retraverse.reports.study_report.chapters.bare_sizes import bare_table

SIZES = {(0, "pillow 4:2:0"): (12_000.0, 11_400.0), (99, "pillow 4:2:0"): (1000.0, 400.0),
         (99, "pillow 4:2:0 optimize"): (600.0, 390.0)}  # fmt: skip


def test_each_encoder_and_compression_has_its_row(tmp_path: Path) -> None:
    runs = [
        make_run(technique=technique, chapter="6", compression=(c, c), encoder=encoder, resize=256,
                 query_bytes_mean=whole, query_bare_bytes_mean=bare)
        for technique in ("hog", "cohog")
        for (c, encoder), (whole, bare) in SIZES.items()
    ]  # fmt: skip
    write_study(tmp_path, runs)
    out = write_study_report(tmp_path, tmp_path / "out").parent
    (path,) = (out / "exports/6").glob("pictures-without-their-constant-tables.csv")
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    found = {(int(row["c"]), row["Encoder"]): row for row in rows}
    assert len(rows) == len(found) == len(SIZES)
    for key, (whole, bare) in SIZES.items():
        assert float(found[key]["Picture"]) == whole
        assert float(found[key]["Without tables"]) == bare
        assert float(found[key]["Saved"]) == pytest.approx(1 - bare / whole)


def test_where_it_was_not_measured_there_is_no_row() -> None:
    assert bare_table([make_run(chapter="6", compression=(50, 50))]).rows == ()
