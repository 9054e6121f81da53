"""The thesis' studies as plans: one TOML file for each, on every dataset that is here.

The plans are the files of ``studies/chapters``; they name techniques, lengths, compressions and
sizes as each chapter has them, and what is added to it. Datasets are those of the
thesis and the small public ones, looked for under one data root; what is not there is recorded as
missing, as are techniques whose weights are not.
"""

import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from retraverse.datasets.known import find_dataset, known_datasets
from retraverse.errors import ConfigError, DataMissingError
from retraverse.registry import unknown_name
from retraverse.studies.plans.plan import StudyPlan
from retraverse.studies.plans.plan_file import read_plan

__all__ = ["CHAPTERS", "chapter_plans", "datasets_here"]

CHAPTERS = ("3", "4", "5", "6", "7", "beyond")
"""What can be reproduced."""


def chapter_plans(
    data: str | Path, *, chapters: Sequence[str] = CHAPTERS, datasets: Sequence[str] = ()
) -> tuple[StudyPlan, ...]:
    """Return the plans of some chapters on the datasets of a data root.

    Parameters
    ----------
    data : path
        Folder with one folder for each dataset.
    chapters : sequence of str
        Of `CHAPTERS`.
    datasets : sequence of str
        Names; empty = all known ones. Any other folder of drives in `data` can be named, too.

    Raises
    ------
    ConfigError
        If there is no such chapter.
    DataMissingError
        If none of the datasets is here.
    PlanError
        If a dataset cannot be read, or is too short for the chapter's sequences.
    """
    for chapter in chapters:
        if chapter not in CHAPTERS:
            raise ConfigError(unknown_name("chapter", chapter, list(CHAPTERS)))
    names = tuple(datasets) or tuple(known.name for known in known_datasets())
    here = datasets_here(data, names)
    if not here:
        raise DataMissingError(
            f"data root {data}: none of {', '.join(names)} is here; expected one folder for each, "
            "with two drives in it"
        )
    return tuple(
        read_plan(_with_datasets(text, names), source=source, data=Path(data), on_missing="record")
        for source, text in _plan_texts()
        if tomllib.loads(text)["chapter"] in chapters
    )


def datasets_here(data: str | Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return which of some datasets are under a data root."""
    return tuple(name for name in names if find_dataset(name, Path(data)) is not None)


def _plan_texts() -> list[tuple[str, str]]:
    folder = files("retraverse.studies") / "chapters"
    found = sorted(item.name for item in folder.iterdir() if item.name.endswith(".toml"))
    # The chapters' own order: what is beyond them comes last.
    ordered = sorted(found, key=lambda name: name.startswith("beyond"))
    return [(name, (folder / name).read_text(encoding="utf-8")) for name in ordered]


def _with_datasets(text: str, names: Sequence[str]) -> str:
    listed = ", ".join(f'"{name}"' for name in names)
    return f"datasets = [{listed}]\n{text}"
