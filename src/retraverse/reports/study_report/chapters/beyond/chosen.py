"""Which runs answer which question, told from what the runs are and not from their plans.

A run may belong to several plans and is then kept once: the name of its plan is no sign.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from retraverse.datasets.driven_again import recorded_name
from retraverse.reports.study_report.series import is_whole, place_of
from retraverse.studies.judging.selection import Condition, condition_of
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "Setting",
    "compared_matchers",
    "driven_again",
    "read_settings",
    "setting_of",
    "settings_with",
    "speed_words",
]


class Setting(NamedTuple):
    """A run but for what was done to its pictures; their size belongs to it."""

    condition: Condition
    length: str


def setting_of(run: RunRecord) -> Setting:
    """Return the setting of a run."""
    condition = replace(
        condition_of(run),
        compression_query=-1,
        compression_reference=-1,
        encoder="",
        jpeg_part="",
        video="",
        video_quality=-1,
        group_length=0,
        descriptor_coding="",
    )
    return Setting(condition, run.sequence_length)


def settings_with(
    records: Iterable[RunRecord], is_wanted: Callable[[RunRecord], bool]
) -> Mapping[Setting, Sequence[RunRecord]]:
    """Return the runs of every setting in which at least one run is wanted, sorted by setting."""
    found: dict[Setting, list[RunRecord]] = {}
    for run in records:
        if run.status == "ok":
            found.setdefault(setting_of(run), []).append(run)
    ordered = sorted(found, key=lambda key: (key.condition, len(key.length), key.length))
    return {key: found[key] for key in ordered if any(map(is_wanted, found[key]))}


def compared_matchers(records: Iterable[RunRecord]) -> list[RunRecord]:
    """Return the runs of drives as recorded that some other matcher was tried beside.

    Drives at another speed are compared elsewhere. Where there are any, a drive as recorded needs
    more than one c to be here: at one c it is only what the others are compared with.
    """
    records = list(records)
    alike = [
        run
        for run in records
        if run.status == "ok" and is_whole(run) and place_of(run).is_uniform and not _speed(run)
    ]
    compared = _of_one_size(_with_several(alike, _but_matcher, lambda run: run.matcher))
    steps: dict[str, set[int]] = {}
    for run in compared:
        steps.setdefault(run.dataset, set()).add(run.compression_query)
    least = 2 if any(map(_speed, records)) else 1
    return [run for run in compared if len(steps[run.dataset]) >= least]


def driven_again(records: Iterable[RunRecord]) -> list[RunRecord]:
    """Return the runs of drives at another speed, and those of the drive as recorded beside."""
    alike = [
        run for run in records if run.status == "ok" and is_whole(run) and place_of(run).is_uniform
    ]
    return _with_several(alike, _but_speed, lambda run: run.dataset)


def read_settings(records: Iterable[RunRecord]) -> list[RunRecord]:
    """Return the runs of plans that measured what can be read; "nothing" may be among the results.

    Every plan measures it for all of its runs or for none.
    """
    records = [run for run in records if run.status == "ok"]
    measured = {run.study for run in records if run.legible_height == run.legible_height}
    return [run for run in records if run.study in measured and is_whole(run)]


def speed_words(dataset: str) -> str:
    """Return how a dataset was driven: "constant speed", "with stops"."""
    recorded = recorded_name(dataset)[0]
    return dataset.removeprefix(recorded).removeprefix(", ") or "constant speed"


def _of_one_size(runs: Sequence[RunRecord]) -> list[RunRecord]:
    """Return the runs on the largest pictures, those as they are before any other."""
    sizes = {run.resize for run in runs}
    size = 0 if 0 in sizes else max(sizes, default=0)
    return [run for run in runs if run.resize == size]


def _speed(run: RunRecord) -> bool:
    return recorded_name(run.dataset)[1] != "constant"


def _but_matcher(run: RunRecord) -> tuple[Condition, str]:
    return replace(condition_of(run), matcher=""), run.sequence_length


def _but_speed(run: RunRecord) -> tuple[Condition, str]:
    condition = condition_of(run)
    return replace(condition, dataset=recorded_name(run.dataset)[0]), run.sequence_length


def _with_several(
    runs: Sequence[RunRecord],
    key_of: Callable[[RunRecord], tuple[Condition, str]],
    value_of: Callable[[RunRecord], str],
) -> list[RunRecord]:
    """Return the runs with whose key there is more than one value."""
    values: dict[tuple[Condition, str], set[str]] = {}
    for run in runs:
        values.setdefault(key_of(run), set()).add(value_of(run))
    return [run for run in runs if len(values[key_of(run)]) > 1]
