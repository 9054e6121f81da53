"""The thesis' chapters as plans: whole, on the datasets that are here, each technique known."""

from pathlib import Path

import pytest
from tests.unit.studies.tiny import write_dataset

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError
from retraverse.studies.reproduce import CHAPTERS, chapter_plans, datasets_here

LEVELS = (0, 50, 80, 90, 95, 97, 99)
"""studies.md's compressions, chapters 5 and 6."""
SPEEDS = ("", ", varying speed", ", with stops", ", with jumps")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_dataset(tmp_path / "corridor", n_frames=24)
    write_dataset(tmp_path / "mine", n_frames=24)
    return tmp_path


def test_every_chapter_has_a_plan_on_what_is_here(data: Path) -> None:
    plans = chapter_plans(data)
    assert {plan.chapter for plan in plans} == set(CHAPTERS)
    assert [plan.chapter for plan in plans][-2:] == ["beyond", "beyond"]
    known = {info.name for info in rt.techniques()}
    for plan in plans:
        assert plan.datasets[0].name == "corridor"
        assert "nordland" in plan.missing
        assert {choice.name for choice in plan.techniques} <= known
        assert plan.n_runs > 0


def test_the_chapters_ask_for_what_the_thesis_has(data: Path) -> None:
    of_chapter = {plan.name: plan for plan in chapter_plans(data)}
    third = of_chapter["chapter 3"]
    (own,) = (choice for choice in third.techniques if choice.name == "convsequential")
    assert own.sequence_lengths == (*range(1, 21), "dynamic")
    for name in ("chapter 5", "chapter 6, 256 pixels", "chapter 6, 224 pixels"):
        pairs = {
            (pair.query.compression, pair.reference.compression) for pair in of_chapter[name].pairs
        }
        uniform = {(level, level) for level in LEVELS}
        one_sided = {(level, 0) for level in LEVELS} | {(0, level) for level in LEVELS}
        assert pairs == uniform | one_sided
    speeds = [dataset.name for dataset in of_chapter["changing speed"].datasets]
    assert speeds == [f"corridor{words}" for words in SPEEDS]
    sizes = {pair.query.resize for pair in of_chapter["chapter 7"].pairs}
    assert sizes == {16, 32, 64, 128, 256, 512, 1024}
    assert {pair.query.compression for pair in of_chapter["chapter 7"].pairs} == {25}
    assert {pair.query.resize for pair in of_chapter["chapter 6, 224 pixels"].pairs} == {224}


def test_one_chapter_on_a_route_of_ones_own(data: Path) -> None:
    (plan,) = chapter_plans(data, chapters=["7"], datasets=["mine"])
    assert [dataset.name for dataset in plan.datasets] == ["mine"]
    assert not plan.missing


def test_what_cannot_be_reproduced_is_said(data: Path) -> None:
    with pytest.raises(ConfigError, match="unknown chapter: got '8'"):
        chapter_plans(data, chapters=["8"])
    with pytest.raises(DataMissingError, match="none of elsewhere is here"):
        chapter_plans(data, datasets=["elsewhere"])
    assert datasets_here(data, ["mine", "elsewhere"]) == ("mine",)
