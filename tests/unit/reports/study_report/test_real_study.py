"""From a simulated street to its report: what the engine records is what the pages show."""

import json
from pathlib import Path

import pytest

from retraverse.datasets.known import find_dataset
from retraverse.datasets.simulated import Camera, Disturbances, simulate_route, write_drive
from retraverse.reports import write_study_report
from retraverse.reports.study_report.run_files import run_address
from retraverse.studies.engine import run_study
from retraverse.studies.judging.expectations import check_expectations
from retraverse.studies.keeping.light_records import read_light_records
from retraverse.studies.plans.plan_file import read_plan

PLAN = """
name = "street"
chapter = "6"
datasets = ["street"]
techniques = ["hog"]
sequence_lengths = ["1..3", "dynamic"]
[images]
resize = [64]
encoders = [{ optimize = true }, {}]
[compression]
levels = [0, 95]
pairs = ["uniform", "query", "reference"]
"""


@pytest.fixture(scope="module", name="study")
def _study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("real")
    route = simulate_route(
        3, 16, query=Disturbances(), camera=Camera(width=96, height=64), spacing_m=8.0
    )
    write_drive(route.query, folder / "data" / "street" / "query")
    write_drive(route.reference, folder / "data" / "street" / "reference")
    plan = read_plan(PLAN, data=folder / "data")
    result = run_study(plan, folder / "study", workers=0)
    assert (result.n_failed, result.n_missing) == (0, 0)
    return folder


def test_a_real_study_becomes_pages(study: Path) -> None:
    def pictures(name: str) -> object:
        return find_dataset(name, study / "data")

    index = write_study_report(study / "study", study / "out", pictures=pictures)  # type: ignore[arg-type]
    page = (index.parent / "chapter-6.html").read_text()
    for title in ("Figure 6.1", "Table 6.1", "Figure 6.2", "Tables 6.3 to 6.6"):
        assert title in page
    # Sizes beside each other, by the word in which the encoders differ.
    assert "optimising encoder" in page
    assert "plain encoder" in page
    for run in read_light_records([study / "study"]):
        file = index.parent / "runs" / f"{run_address(run)[0]}.js"
        data = json.loads(file.read_text().partition(",")[2].removesuffix(");\n"))
        assert data["runs"][run.sequence_length][1] == run.run_id[:16]
        assert data["matrix"]["shape"] == [run.n_queries, run.n_references]
        matches = data["matches"].get(run.sequence_length)
        assert matches is None or len(matches["p"]) > 0


def test_expectations_are_tested_on_a_real_study(study: Path) -> None:
    found = {item.name: item for item in check_expectations(read_light_records([study / "study"]))}
    assert found["bytes-fall"].holds is True
    assert found["bytes-fall"].numbers.startswith("2 of 2")  # two encoders
    assert found["accuracy-rises"].holds is not None
    assert found["orb-needs-size"].holds is None
