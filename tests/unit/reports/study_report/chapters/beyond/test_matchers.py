"""Matchers under compression: tables with the best marked, means over the techniques."""

import csv
import io
from pathlib import Path

import pytest
from tests.unit.reports.study_report.made_up import make_run, write_study
from tests.unit.reports.test_comparison_report import Page

from retraverse.reports import write_study_report
from retraverse.reports.study_report.chapters.beyond.chosen import compared_matchers
from retraverse.studies.keeping.records import RunRecord

ACCURACY = {
    ("hog", "mean"): 0.4,
    ("hog", "dtw"): 0.6,
    ("cohog", "mean"): 0.9,
    ("cohog", "dtw"): 0.5,
}
STEPS = (0, 99)


def made_runs() -> list[RunRecord]:
    """Return two techniques with two matchers at two c."""
    return [
        make_run(technique=technique, length="10", chapter="beyond", accuracy=accuracy - c / 990,
                 compression=(c, c), matcher=matcher)
        for (technique, matcher), accuracy in ACCURACY.items()
        for c in STEPS
    ]  # fmt: skip


@pytest.fixture(scope="module", name="report")
def _report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, made_runs())
    return write_study_report(folder, folder / "report").parent


def exported(report: Path, file: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO((report / "exports/beyond" / file).read_text())))


def test_a_table_for_each_dataset_marks_the_best_of_each_column(report: Path) -> None:
    page = Page((report / "beyond.html").read_text())
    assert "Corridor: every matcher at every compression" in page.text
    bold = [attributes for attributes in page.all("b") if attributes.get("class") == "best"]
    # One of each column in the dataset's table, and one in the table of means.
    assert len(bold) == 2 * len(STEPS)
    latex = next((report / "exports/beyond").glob("corridor-every-*.tex")).read_text()
    assert latex.count(r"\textbf{") == len(STEPS)
    best = [run for run in made_runs() if (run.technique, run.matcher) == ("cohog", "mean")]
    for run in best:
        assert rf"\textbf{{{100 * run.accuracy:.1f}\,\%}}" in latex


def test_means_are_over_the_techniques(report: Path) -> None:
    rows = exported(report, "matchers-under-compression-mean-of-the-techniques.csv")
    assert sorted(row["Matcher"] for row in rows) == ["dtw", "mean"]
    for row in rows:
        assert row["Techniques"] == "2"
        for c in STEPS:
            wanted = [run.accuracy for run in made_runs()
                      if run.matcher == row["Matcher"] and run.compression_query == c]  # fmt: skip
            assert float(row[f"c = {c}"]) == pytest.approx(sum(wanted) / len(wanted))


def test_a_matcher_that_missed_a_technique_has_no_mean(tmp_path: Path) -> None:
    third = [
        make_run(technique=run.technique, length="10", chapter="beyond", accuracy=0.5,
                 compression=(run.compression_query,) * 2, matcher="hmm")
        for run in made_runs()
    ]  # fmt: skip
    kept = [run for run in made_runs() if (run.technique, run.matcher) != ("hog", "mean")]
    write_study(tmp_path, [*kept, *third])
    out = write_study_report(tmp_path, tmp_path / "out").parent
    rows = exported(out, "matchers-under-compression-mean-of-the-techniques.csv")
    assert sorted(row["Matcher"] for row in rows) == ["dtw", "hmm"]
    table = next((out / "exports/beyond").glob("corridor-every-matcher*.csv")).read_text()
    assert "cohog,mean" in table


def test_one_matcher_is_no_comparison() -> None:
    runs = made_runs()
    assert len(compared_matchers(runs)) == len(runs)
    assert compared_matchers(run for run in runs if run.matcher == "mean") == []
    assert compared_matchers([]) == []


def test_what_only_one_matcher_was_tried_on_is_left_out() -> None:
    # A plan without other matchers has more c and techniques, and belongs elsewhere.
    others = [
        make_run(technique=technique, length="10", compression=(c, c), chapter="beyond")
        for technique in ("hog", "orb")
        for c in (-1, 50)
    ]
    part = make_run(length="10", compression=(99, 99), jpeg_part="grid", matcher="dtw")
    runs = [*others, part, *made_runs()]
    assert {run.run_id for run in compared_matchers(runs)} == {run.run_id for run in made_runs()}


def test_the_largest_pictures_stand_for_all() -> None:
    small = [
        make_run(length="10", compression=(c, c), resize=64, matcher=matcher)
        for c in STEPS
        for matcher in ("mean", "dtw")
    ]
    assert {run.resize for run in compared_matchers([*small, *made_runs()])} == {0}
    assert len(compared_matchers(small)) == len(small)
