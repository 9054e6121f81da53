"""Pictures without a region of interest: a study says it once, however many tasks it has."""

import logging
from pathlib import Path

import pytest
from tests.unit.studies.tiny import tiny_plan, write_dataset

from retraverse.studies.engine import run_study

N = 12


def cohog(roi_entropy: float) -> str:
    return f'{{ name = "cohog", parameters = {{ resolution = 64, roi_entropy = {roi_entropy} }} }}'


def said_by(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.message for record in caplog.records]


@pytest.mark.parametrize("workers", [0, 2])
def test_one_warning_a_study(
    tmp_path: Path,
    workers: int,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    for name in ("noise", "other"):
        write_dataset(tmp_path / "data" / name, n_frames=N)
    plan = tiny_plan(
        tmp_path / "data",
        datasets='["noise", "other"]',
        techniques=f'[{cohog(0.792)}, {{ name = "hog", parameters = {{ resolution = 64 }} }}]',
        modules="[]",
    )
    with caplog.at_level(logging.WARNING, "retraverse"):
        result = run_study(plan, tmp_path / "study", workers=workers)
    assert result.n_ok == 2 * 4 * 3 * 2
    # Two datasets at four pairs of c each.
    (said,) = said_by(caplog)
    assert said.startswith(
        f"cohog: {2 * 4 * N} of {2 * 4 * N} pictures have no region with entropy >= "
    )
    assert "no region" not in capfd.readouterr().err, "workers leave it to the one who counts"


def test_thresholds_are_told_apart_and_enough_entropy_is_not_mentioned(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_dataset(tmp_path / "data" / "noise", n_frames=N)
    plan = tiny_plan(
        tmp_path / "data",
        techniques=f"[{cohog(0.792)}, {cohog(0.7921)}, {cohog(0.1)}]",
        sequence_lengths="[2]",
        modules="[]",
    )
    with caplog.at_level(logging.WARNING, "retraverse"):
        run_study(plan, tmp_path / "study", workers=0)
    assert len(said_by(caplog)) == 2
    caplog.clear()
    run_study(plan, tmp_path / "study", workers=0)
    assert said_by(caplog) == [], "nothing was compared"
