"""The pictures of a run are those of the drive it was made on."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from tests.unit.reports.study_report.made_up import make_run
from tests.unit.studies.tiny import write_dataset

from retraverse.datasets.driven_again import find_driven
from retraverse.reports.study_report.picture_files import PictureFiles


def test_a_drive_at_another_speed_shows_its_own_frames(tmp_path: Path) -> None:
    write_dataset(tmp_path / "corridor", n_frames=20)
    files = PictureFiles(tmp_path / "out", partial(find_driven, root=tmp_path))
    plain = replace(make_run("corridor"), n_queries=20, n_references=20)
    backwards = replace(plain, dataset="corridor, backwards")
    assert files.frame_name(plain, "query", 3) == "003.png"
    assert files.frame_name(backwards, "query", 3) == "016.png"
    assert files.frame_name(backwards, "reference", 3) == "003.png"
    truth = files.truth(backwards)
    assert truth is not None
    assert truth.is_correct([3], [16]).all()
    addresses = [files.address(run, "query", 3) for run in (plain, backwards)]
    assert len(set(addresses)) == 2
    assert all((tmp_path / "out" / address).is_file() for address in addresses)


@pytest.mark.parametrize(
    "values",
    [
        {"compression": (99, 99), "jpeg_part": "means"},
        {"video": "h265", "video_quality": 51, "group_length": 4},
    ],
    ids=["part", "video"],
)
def test_pictures_are_those_that_were_matched(tmp_path: Path, values: dict[str, Any]) -> None:
    if "video" in values:
        pytest.importorskip("av")
    write_dataset(tmp_path / "corridor", n_frames=12)
    files = PictureFiles(tmp_path / "out", partial(find_driven, root=tmp_path))
    plain, damaged = (
        replace(make_run("corridor", **given), n_queries=12, n_references=12)
        for given in ({}, values)
    )
    shown = [files.address(run, "query", 5) for run in (plain, damaged)]
    assert len({(tmp_path / "out" / address).read_bytes() for address in shown}) == 2
    # A map is damaged by parts of JPEG, and left as it is beside video.
    of_map = [files.address(run, "reference", 5) for run in (plain, damaged)]
    assert (of_map[0] == of_map[1]) == ("video" in values)
