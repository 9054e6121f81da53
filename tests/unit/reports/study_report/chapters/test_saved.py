"""What compression saves: the table of chapter 6, by numbers one can check by hand."""

import csv
import io
from dataclasses import replace
from pathlib import Path

from tests.unit.reports.study_report.made_up import make_run, write_study

from retraverse.reports import write_study_report
from retraverse.studies.keeping.records import RunRecord


def runs_at(compression: int, n_bytes: int, *accuracies: float) -> list[RunRecord]:
    made = [
        make_run(
            length=str(k),
            chapter="6",
            accuracy=accuracy,
            compression=(compression, compression),
            resize=256,
        )
        for k, accuracy in enumerate(accuracies, 1)
    ]
    return [
        replace(
            run,
            query_bytes_mean=float(n_bytes),
            reference_bytes_mean=float(n_bytes),
            query_bytes_total=n_bytes * run.n_queries,
            reference_bytes_total=n_bytes * run.n_references,
            descriptor_bytes=4000,
        )
        for run in made
    ]


def test_bytes_at_equal_accuracy(tmp_path: Path) -> None:
    runs = runs_at(0, 10_000, 0.6, 0.8, 0.9) + runs_at(95, 1000, 0.4, 0.65, 0.7)
    write_study(tmp_path / "study", runs)
    report = write_study_report(tmp_path / "study", tmp_path / "report").parent
    (file,) = (report / "exports" / "6").glob("*what-c-95-saves*.csv")
    (row,) = csv.DictReader(io.StringIO(file.read_text()))
    # One clean picture of 10 kB is equalled by two of 1 kB; five and ten frames are not there.
    assert row["K, clean"] == "1"
    assert row["K, c = 95"] == "2"
    assert row["Saved against pictures"].startswith("0.8")
    assert row["Saved against descriptors"].startswith("0.5")
