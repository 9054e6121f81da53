"""Figure 3.2: regions of interest over query pictures, by the technique's own entropies."""

from pathlib import Path

import numpy as np
import pytest
from tests.unit.reports.study_report.made_up import ROUTES, MadeUpDrives, make_run, write_study
from tests.unit.reports.test_comparison_report import Page

from retraverse.images import Frame, Traverse
from retraverse.reports import write_study_report
from retraverse.reports.study_report.chapters.regions import THRESHOLDS, shaded
from retraverse.studies.keeping.records import RunRecord


class HalfNoise(MadeUpDrives):
    """Drives whose pictures are noise on the left and flat on the right."""

    def _drive(self, name: str, shade: int) -> Traverse:
        rng = np.random.default_rng(7)
        picture = np.full((64, 64, 3), 128, np.uint8)
        picture[:, :32] = rng.integers(0, 256, (64, 32, 1), np.uint8)
        frames = [Frame.from_array(picture, name=f"{at}.png", index=at)
                  for at in range(self.n_frames)]  # fmt: skip
        return Traverse(name, name, tuple(frames))


def own_runs() -> list[RunRecord]:
    return [
        make_run("corridor", "convsequential", length, chapter="3",
                 technique_parameters='{"roi_entropy": 0.45}')
        for length in ("1", "10")
    ]  # fmt: skip


@pytest.fixture(scope="module", name="report")
def _report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("regions")
    write_study(folder, own_runs())
    drives = {"corridor": HalfNoise(ROUTES["corridor"])}
    return write_study_report(folder, folder / "report", pictures=drives.get).parent


def test_three_pictures_have_their_regions_drawn_with_words_for_each(report: Path) -> None:
    page = Page((report / "chapter-3.html").read_text())
    assert "Figure 3.2" in page.text
    assert "The runs of this page have ET = 0.45" in page.text
    shown = [image for image in page.all("img") if "regions of interest" in (image["alt"] or "")]
    assert len(shown) == 3 * len(THRESHOLDS)
    assert all((report / (image["src"] or "")).is_file() for image in shown)
    counts = [int((image["alt"] or "").rsplit(": ", 1)[1].split()[0]) for image in shown]
    for at in range(0, len(counts), len(THRESHOLDS)):
        row = counts[at : at + len(THRESHOLDS)]
        assert row == sorted(row, reverse=True)  # a higher ET leaves out more
        assert 0 < row[0] < 961


def test_the_flat_half_is_dark_and_the_textured_half_is_not(report: Path) -> None:
    import cv2

    (path,) = (report / "pictures/corridor").glob("q10-et0-4-*.jpg")
    picture = cv2.imread(str(path))
    assert picture is not None
    width = picture.shape[1]
    left, right = picture[:, : width // 3], picture[:, 2 * width // 3 :]
    assert left.mean() > 90
    assert right.mean() < 45


def test_without_pictures_there_is_none(tmp_path: Path) -> None:
    write_study(tmp_path, own_runs())
    out = write_study_report(tmp_path, tmp_path / "out").parent
    assert "Figure 3.2" not in (out / "chapter-3.html").read_text()
    assert not (out / "pictures").exists()


def test_a_region_covers_two_by_two_cells() -> None:
    picture = np.full((40, 80, 3), 200, np.uint8)
    chosen = np.zeros(9, bool)
    chosen[4] = True  # the middle one of 3 x 3, over cells 1 and 2 of 4 x 4
    light = shaded(picture, chosen)[..., 0] == 200
    wanted = np.zeros((40, 80), bool)
    wanted[10:30, 20:60] = True
    assert (light == wanted).all()
    assert not (shaded(picture, np.zeros(9, bool)) == 200).any()
    assert (shaded(picture, np.ones(9, bool)) == 200).all()
