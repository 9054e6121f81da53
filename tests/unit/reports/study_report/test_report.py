"""The pages of a study as files: complete, safe, drawn from records, small."""

import csv
import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.reports.records import HOSTILE
from tests.unit.reports.study_report.made_up import (
    MATRIX,
    ROUTES,
    MadeUpDrives,
    chapter_runs,
    make_run,
    write_study,
)
from tests.unit.reports.test_comparison_report import Page

from retraverse.errors import DataMissingError, InputError
from retraverse.reports import write_study_report
from retraverse.reports.study_report.picture_files import PictureFiles, Side
from retraverse.reports.study_report.run_files import RunFiles
from retraverse.studies.keeping.records import RunRecord
from retraverse.types import no_progress

PAGES = ("index", "chapter-3", "chapter-4", "chapter-5", "chapter-6", "chapter-7", "runs")
MOST_BYTES = {"page": 60_000, "figure": 1500, "panel": 4500, "use": 100, "cell": 90}
"""What a page may take: for itself, and for each figure, panel, point and cell it shows."""


@pytest.fixture(scope="module", name="report")
def _report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    runs = [
        run
        for chapter in ("3", "4", "5", "6", "7", "")
        for run in chapter_runs(chapter, matrix=MATRIX)
    ]
    lost = replace(make_run("nordland", chapter="4"), status="missing", error="dataset not here")
    write_study(folder, [*runs, lost])
    return write_study_report(folder, folder / "report").parent


@pytest.fixture(scope="module", name="pages")
def _pages(report: Path) -> dict[str, Page]:
    return {name: Page((report / f"{name}.html").read_text()) for name in PAGES}


def opened(report: Path, run: RunRecord) -> dict[str, object]:
    """Return what the page is given when it opens a run."""
    from retraverse.reports.study_report.run_files import run_address

    text = (report / "runs" / f"{run_address(run)[0]}.js").read_text()
    found = re.fullmatch(r'openedRuns\("[0-9a-f]+",(.*)\);\n', text, re.DOTALL)
    assert found is not None
    data: dict[str, object] = json.loads(found[1])
    return data


def rows_of(report: Path, file: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO((report / "exports" / file).read_text())))


def test_there_is_a_page_for_every_chapter_of_the_records(report: Path) -> None:
    assert sorted(path.stem for path in report.glob("*.html")) == sorted(PAGES)


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_small_whole_and_ask_for_nothing_elsewhere(
    report: Path, pages: dict[str, Page], name: str
) -> None:
    page = pages[name]
    addresses = [attributes["href"] or "" for attributes in page.all("a")]
    assert addresses
    for address in addresses:
        assert "//" not in address
        file, _, anchor = address.partition("#")
        assert (report / file).is_file(), address
        assert not anchor or f'id="{anchor}"' in (report / file).read_text(), address
    assert [tag for tag, attributes in page.tags if "src" in attributes] == []
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    labels = [a["aria-labelledby"] for _, a in page.tags if "aria-labelledby" in a]
    assert set(labels) <= set(ids)


@pytest.mark.parametrize("name", PAGES)
def test_pages_take_few_bytes_for_what_they_show(
    report: Path, pages: dict[str, Page], name: str
) -> None:
    tags = [tag for tag, _ in pages[name].tags]
    shown = {
        "page": 1,
        "figure": tags.count("figure"),
        "panel": sum("data-panel" in attributes for _, attributes in pages[name].tags),
        "use": tags.count("use"),
        "cell": tags.count("td") + tags.count("th"),
    }
    most = sum(n * MOST_BYTES[what] for what, n in shown.items())
    assert (report / f"{name}.html").stat().st_size < most


@pytest.mark.parametrize("name", PAGES)
def test_every_drawing_says_what_it_shows(pages: dict[str, Page], name: str) -> None:
    drawings = [svg for svg in pages[name].all("svg") if svg.get("aria-hidden") != "true"]
    assert all(svg.get("role") == "img" and svg.get("aria-label") for svg in drawings)
    assert (len(drawings) > 0) == (name != "index")


@pytest.mark.parametrize(
    ("name", "artefacts"),
    [
        ("chapter-3", "Figure 3.4,Table 3.1,Figure 3.5,Figure 3.6,Figure 3.7,Figure 3.8,"
                      "Figure 3.9,Figure 3.10"),
        ("chapter-4", "Table 4.1,Figure 4.3,Figure 4.4,Table 4.2,Figure 4.7,Figure 4.8,"
                      "Tables 4.3, 4.4"),
        ("chapter-5", "Table 5.1,Figure 5.4,Figure 5.3,Figures 5.5, 5.6,Figure 5.7,Figure 5.8"),
        ("chapter-6", "Figure 6.1,Table 6.1,Figure 6.2,Figure 6.3,Figure 6.4,Figure 6.6,"
                      "Figure 6.5,Figure 6.7,Table 6.2,Tables 6.3 to 6.6"),
        ("chapter-7", "Figure 7.2,Figure 7.3,Figure 7.4,Table 7.1,Figure 7.5,Figure 7.6,"
                      "Table 7.2,Table 7.3"),
    ],
)  # fmt: skip
def test_every_table_and_figure_of_the_chapter_is_there(
    pages: dict[str, Page], name: str, artefacts: str
) -> None:
    for number in re.split(r",(?! )", artefacts):
        assert number in pages[name].text, number


def test_published_values_stand_beside_ours_where_the_thesis_pictures_are_here(
    pages: dict[str, Page],
) -> None:
    assert "thesis 0.301" in pages["chapter-3"].text  # HOG on Campus Loop, table 3.1
    assert "thesis 19" in pages["chapter-4"].text  # its smallest K, table 4.1
    assert "thesis 46.8 MB" in pages["chapter-5"].text  # Campus Loop at c = 0, table 5.1
    assert "thesis 2.01 ms" in pages["chapter-7"].text  # HOG at 256 px, table 7.3
    assert "thesis 0.431" not in pages["chapter-3"].text  # Gardens Point, which is not here
    assert "dataset not here" in pages["chapter-3"].text


def test_published_values_can_be_left_out(tmp_path: Path) -> None:
    write_study(tmp_path, [make_run("campus_loop", length=k, chapter="4") for k in ("1", "2")])
    shown = write_study_report(tmp_path, tmp_path / "out", published=False)
    assert 'class="published"' not in (shown.parent / "chapter-4.html").read_text()


def test_numbers_name_their_definition_tolerance_and_queries(pages: dict[str, Page]) -> None:
    text = pages["chapter-4"].text
    assert "60 queries, ±2 frames" in text
    assert "Windows answered correctly / windows answered" in text
    assert "undefined where a 1 = 0" in text.replace("_", " ")


def test_the_exported_table_holds_the_records_numbers(report: Path) -> None:
    (hog,) = [
        row
        for row in rows_of(report, "4/table-4-1-smallest-k-with-100-accuracy.csv")
        if (row["Technique"], row["Dataset"]) == ("hog", "Corridor")
    ]
    runs = {run.sequence_length: run for run in chapter_runs("4")
            if (run.technique, run.dataset) == ("hog", "corridor")}  # fmt: skip
    full = min(int(k) for k, run in runs.items() if run.accuracy == 1)
    assert int(hog["Smallest K"]) == full
    assert float(hog["Accuracy at K = 1"]) == pytest.approx(runs["1"].accuracy)
    assert int(hog["Windows left"]) == ROUTES["corridor"] - full + 1


def test_the_exported_figure_holds_the_records_points(report: Path) -> None:
    rows = rows_of(report, "4/accuracy-over-sequence-length.csv")
    for run in chapter_runs("4"):
        (point,) = [row for row in rows if row["run"] == run.run_id]
        assert float(point["y"]) == pytest.approx(100 * run.accuracy)
        assert float(point["x"]) == int(run.sequence_length)


def test_drawings_and_tables_can_be_taken_along(report: Path) -> None:
    drawing = (report / "exports/4/accuracy-over-sequence-length-corridor.svg").read_text()
    assert drawing.startswith("<?xml")
    assert 'xmlns="http://www.w3.org/2000/svg"' in drawing
    assert "var(--" not in drawing
    table = (report / "exports/4/table-4-1-smallest-k-with-100-accuracy.tex").read_text()
    assert table.count(r"\\") == 1 + 4 + 3  # head, two techniques on two datasets, three absent
    assert r"\multicolumn{5}{l}{dataset not here}" in table


def test_a_run_opens_with_settings_matrix_and_answers(report: Path) -> None:
    run = next(r for r in chapter_runs("4") if (r.technique, r.sequence_length) == ("hog", "5"))
    data = opened(report, run)
    assert data["title"] == "hog on Corridor"
    assert data["measured"] == "60 queries, ±2 frames"
    assert ["Parameters", "cell_size 16"] in data["settings"]  # type: ignore[operator]
    assert data["matrix"]["shape"] == [60, 60]  # type: ignore[index]
    assert "1" in data["runs"]  # type: ignore[operator]
    matches = data["matches"]["1"]  # type: ignore[index]
    single = next(r for r in chapter_runs("4") if (r.technique, r.sequence_length) == ("hog", "1"))
    assert tuple(matches["r"]) == single.answer_reference
    assert tuple(map(bool, matches["c"])) == single.answer_correct
    assert matches["p"] == {}


def test_matches_are_shown_in_pictures_where_they_are_at_hand(tmp_path: Path) -> None:
    runs = [make_run(chapter="5", compression=(c, c)) for c in (0, 99)]
    write_study(tmp_path, runs)
    drives = {"corridor": MadeUpDrives(ROUTES["corridor"])}
    out = write_study_report(tmp_path, tmp_path / "out", pictures=drives.get).parent
    matches = opened(out, runs[1])["matches"]["1"]  # type: ignore[index]
    assert 0 < len(matches["p"]) <= 16
    for at, pictures in matches["p"].items():
        assert len(pictures) == 3
        assert all((out / address).is_file() for address, _ in pictures)
        assert f"query_{at}.png" == pictures[0][1]
        assert abs(matches["t"][int(at)] - int(at)) <= 2
    (good, bad), bad_name = (
        (shade(out / opened(out, run)["matches"]["1"]["p"]["0"][0][0]) for run in runs),  # type: ignore[index]
        matches["p"]["0"][0][0],
    )
    assert "c99" in bad_name
    assert np.abs(good - bad).mean() > 2  # at the compression used


def test_the_first_of_many_runs_leave_pictures_to_the_last(tmp_path: Path) -> None:
    runs = [make_run(chapter="5", compression=(c, c)) for c in range(0, 90, 10)]
    write_study(tmp_path, runs)
    drives = {"corridor": MadeUpDrives(ROUTES["corridor"])}
    pictures = PictureFiles(tmp_path / "out", drives.get, most=240)
    files = RunFiles(tmp_path / "out", [], pictures, lambda chosen: chosen)
    assert files.write(runs, no_progress) == len(runs)
    assert len(list((tmp_path / "out").rglob("*.jpg"))) == 240
    for run in runs:
        shown = opened(tmp_path / "out", run)["matches"]["1"]["p"]  # type: ignore[index]
        assert sum(bool(address) for trio in shown.values() for address, _ in trio) >= 240 // 9


def test_sheets_come_before_the_pictures_of_runs(tmp_path: Path) -> None:
    seen: list[str] = []

    class Noting(PictureFiles):
        def address(self, run: RunRecord, side: Side, frame: int) -> str:
            seen.append("picture")
            return super().address(run, side, frame)

    def progress(items: object, *, total: int, label: str) -> object:
        seen.append(label)
        return items

    write_study(tmp_path, [make_run(chapter="4", length=k) for k in ("1", "5")])
    drives = {"corridor": MadeUpDrives(ROUTES["corridor"])}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("retraverse.reports.study_report.report.PictureFiles", Noting)
        write_study_report(
            tmp_path,
            tmp_path / "out",
            pictures=drives.get,
            progress=progress,  # type: ignore[arg-type]
        )
    assert seen[0] == "pages of the report"
    assert seen[1] == "picture"
    assert seen.index("runs of the report") > 48


def test_dataset_sizes_of_chapter_7_are_those_of_its_jpegs(tmp_path: Path) -> None:
    sizes = (16, 64)
    runs = [make_run(chapter="7", resize=size, compression=(25, 25)) for size in sizes]
    write_study(tmp_path, [*runs, make_run(chapter="7", resize=64, compression=(99, 99))])
    out = write_study_report(tmp_path, tmp_path / "out").parent
    (row,) = [row for row in rows_of(out, "7/table-7-1-size-of-each-dataset.csv")
              if row["Dataset"] == "Corridor"]  # fmt: skip
    for size, run in zip(sizes, runs, strict=True):
        total = run.query_bytes_total + run.reference_bytes_total
        assert float(row[f"{size} px"]) == total


def test_sheets_show_right_and_wrong_sequences(tmp_path: Path) -> None:
    runs = [make_run(chapter="4", length=k) for k in ("1", "5")]
    write_study(tmp_path, runs)
    drives = {"corridor": MadeUpDrives(ROUTES["corridor"])}
    out = write_study_report(tmp_path, tmp_path / "out", pictures=drives.get).parent
    page = Page((out / "chapter-4.html").read_text())
    pictures = page.all("img")
    assert len(pictures) == 2 * 3 * 2 * 4  # right and wrong, cases, query and map, frames
    assert all((out / (picture["src"] or "")).is_file() for picture in pictures)
    assert pictures[0]["alt"] == "Query frame " + re.findall(r"query (\d+) → map", page.text)[0]
    assert "Figures 4.5, 4.6" in page.text
    assert (page.text.count(" correct query"), page.text.count(" wrong query")) == (3, 3)


def shade(path: Path) -> np.ndarray:
    import cv2

    picture = cv2.imread(str(path))
    assert picture is not None
    return picture.astype(float)


def test_pictures_of_another_drive_are_not_shown(tmp_path: Path) -> None:
    write_study(tmp_path, [make_run(chapter="5")])
    drives = {"corridor": MadeUpDrives(7)}
    out = write_study_report(tmp_path, tmp_path / "out", pictures=drives.get).parent
    assert not (out / "pictures").exists()
    assert opened(out, make_run(chapter="5"))["truth"] is False


def test_writing_again_changes_only_what_changed(tmp_path: Path) -> None:
    write_study(tmp_path, [make_run(chapter="4", length=k) for k in ("1", "2")])
    out = write_study_report(tmp_path, tmp_path / "out").parent
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.*")}
    write_study_report(tmp_path, out)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.*")} == before
    write_study(tmp_path, [make_run("campus_loop", chapter="4")], part="later")
    write_study_report(tmp_path, out)
    assert "Campus Loop" in (out / "chapter-4.html").read_text()
    kept = [path for path in before if path.suffix == ".js"]
    assert {path: path.stat().st_mtime_ns for path in kept} == {p: before[p] for p in kept}


@pytest.mark.parametrize(
    "records",
    [
        [],
        [replace(make_run(), status="failed", error="broken")],
        [make_run(chapter="3", length="dynamic", answers=False)],
        [replace(make_run(chapter="6"), accuracy=math.nan, auc=math.nan, vpr_s=math.nan,
                 query_bytes_mean=math.nan, accuracy_low=math.nan)],
        [make_run(chapter="7", resize=16)],
        [replace(make_run(chapter="4"), tolerance_frames=-1, truth="within 25 m")],
        [replace(make_run(chapter="no such chapter"))],
        [make_run(chapter="beyond", accuracy=0.0), make_run(chapter="beyond", length="2")],
    ],
    ids=["none", "failed", "no-answers", "nan", "one-size", "metres", "free", "beyond"],
)  # fmt: skip
def test_little_and_odd_studies_have_pages_too(tmp_path: Path, records: list[RunRecord]) -> None:
    write_study(tmp_path, records)
    index = write_study_report(tmp_path, tmp_path / "out")
    for path in index.parent.glob("*.html"):
        assert "nan" not in re.findall(r">\s*(\w+)\s*<", path.read_text())
    text = Page(index.read_text()).text
    assert ("broken" in text) == any(run.error == "broken" for run in records)


def test_many_lines_are_thinned_and_said_so(tmp_path: Path) -> None:
    runs = [
        make_run(technique=f"technique{at}", chapter="4", length=k, accuracy=(at + int(k)) / 30)
        for at in range(20)
        for k in ("1", "2")
    ]
    write_study(tmp_path, runs)
    out = write_study_report(tmp_path, tmp_path / "out").parent
    assert "The 16 most accurate of 20 lines" in (out / "chapter-4.html").read_text()
    lines = {row["line"] for row in rows_of(out, "4/accuracy-over-sequence-length.csv")}
    assert lines == {f"technique{at}" for at in range(4, 20)}
    table = rows_of(out, "4/table-4-1-smallest-k-with-100-accuracy.csv")
    assert sum(row["Technique"].startswith("technique") for row in table) == 20


def test_hostile_names_are_only_text(tmp_path: Path) -> None:
    run = replace(
        make_run(chapter="4"),
        technique=HOSTILE,
        dataset=HOSTILE,
        matcher=HOSTILE,
        encoder=HOSTILE,
        study=HOSTILE,
        truth=HOSTILE,
        tolerance_frames=-1,
        technique_parameters=json.dumps({HOSTILE: HOSTILE}),
    )
    failed = replace(run, run_id="x", status="failed", error=HOSTILE)
    write_study(tmp_path, [run, failed])
    out = write_study_report(tmp_path, tmp_path / "out").parent
    for path in out.glob("*.html"):
        page = Page(path.read_text())
        assert page.all("img") == []
        assert len(page.all("script")) == 2
    assert all(path.is_relative_to(out) for path in out.rglob("*"))


def test_what_cannot_be_reported_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no study here"):
        write_study_report(tmp_path, tmp_path / "out")
    write_study(tmp_path / "study", [make_run()])
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="got a file"):
        write_study_report(tmp_path / "study", tmp_path / "file")


def test_progress_is_told(tmp_path: Path) -> None:
    seen: list[str] = []

    def progress(items: object, *, total: int, label: str) -> object:
        seen.append(label)
        return items

    shown: Callable[..., object] = progress
    write_study(tmp_path, [make_run()])
    write_study_report(tmp_path, tmp_path / "out", progress=shown)  # type: ignore[arg-type]
    assert seen == ["pages of the report", "runs of the report"]
