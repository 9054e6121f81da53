"""The engineer's question: the cheapest setting that is accurate enough."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from retraverse.datasets.driven_again import recorded_name
from retraverse.reports.study_report.artefacts import Cell, Row, Table
from retraverse.reports.study_report.series import Runs, SeriesBook
from retraverse.reports.study_report.words import (
    codec_title,
    compression_text,
    dataset_title,
    length_words,
    meanings,
    place_text,
    size_text,
)
from retraverse.reports.wording import percent, seconds
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord

__all__ = ["TARGETS", "cheapest", "choices_table", "frame_seconds"]

TARGETS = (0.9, 0.95, 1.0)
"""Accuracies that a choice is made for."""
_FEW = 20
"""Candidates below which a right answer is easy."""
_HEAD = (
    "Dataset",
    "Accuracy at least",
    "Cheapest in",
    "Technique",
    "K",
    "c",
    "Size",
    "Bytes of a window",
    "Time of a frame",
    "Accuracy",
    "Candidates",
)


def frame_seconds(record: RunRecord) -> float:
    """Return the work for every new picture once the robot is under way, seconds.

    t_e + t_m, and where its descriptor is sent what coding it takes; two machines share that.
    """
    return record.encode_s + record.match_s + (record.coding_s if record.descriptor_coding else 0)


def cheapest(
    records: Sequence[RunRecord], target: float, cost: Callable[[RunRecord], float]
) -> RunRecord | None:
    """Return the run of least cost with at least an accuracy; of equals the more accurate.

    Parameters
    ----------
    records : sequence of RunRecord
    target : float in [0, 1]
    cost : callable
        NaN where a run has none; such runs are never the cheapest.
    """
    fitting = [run for run in records if run.accuracy >= target and math.isfinite(cost(run))]
    return min(fitting, key=lambda run: (cost(run), -run.accuracy, run.run_id), default=None)


def choices_table(records: Sequence[RunRecord]) -> Table:
    """Return, for every dataset and target, the settings of fewest bytes and of least time."""
    measured = [run for run in records if _can_be_chosen(run)]
    # Named without encoder, resizer and what is sent, which are written beside c where they count.
    plain = [
        replace(run, encoder="", video="", group_length=0, resizer="", descriptor_coding="")
        for run in measured
    ]
    names = Runs(plain, SeriesBook({}))
    rows = [
        row
        for dataset in names.datasets
        for target in TARGETS
        for row in _rows(names, [run for run in measured if run.dataset == dataset], target)
    ]
    return Table(
        "",
        "Which setting to choose",
        _HEAD,
        tuple(rows),
        "The cheapest of all runs that reaches the accuracy; a click opens it. Being the best of "
        "many flatters a run: its 95 % interval says how sure its accuracy is (100 to 100: no "
        "window was wrong, which says little of few windows). Few candidates "
        f"left (long windows on short drives) make a right answer easy.{_of_descriptors(measured)}",
        meanings("window bytes", "time of a frame", "accuracy", "interval", "K", "c", "candidates"),
        lead=4,
    )


def _of_descriptors(runs: Sequence[RunRecord]) -> str:
    """Return what is to be known of those that send descriptors."""
    if not any(run.coding_shared_bytes > 0 for run in runs):
        return ""
    return (
        " Descriptors are made by who sends them; what must be there before the first stands "
        "beside the bytes of a window, with a plus."
    )


def _known_before(run: RunRecord) -> str:
    shared = run.coding_shared_bytes
    return f"+ {size_text(shared)}" if shared > 0 else ""


def _can_be_chosen(run: RunRecord) -> bool:
    """Say whether a robot could run it: not one part of JPEG, nor a drive made up from another."""
    return run.status == "ok" and not run.jpeg_part and recorded_name(run.dataset)[1] == "constant"


def _alone_seconds(run: RunRecord) -> float:
    """Return the time of a frame; NaN where descriptors are coded.

    Who looks for the least time has the map at hand and sends nothing.
    """
    return math.nan if run.descriptor_coding else frame_seconds(run)


_COSTS: tuple[tuple[str, Callable[[RunRecord], float]], ...] = (
    ("bytes", data_per_answer),
    ("time", _alone_seconds),
)


def _rows(runs: Runs, here: Sequence[RunRecord], target: float) -> list[Row]:
    head = (Cell(dataset_title(here[0].dataset)), Cell(f"{100 * target:g} %", target))
    chosen = _by_run({name: cheapest(here, target, cost) for name, cost in _COSTS})
    if not chosen:
        best = max(here, key=lambda run: run.accuracy)
        most = f"none; the most accurate is {percent(best.accuracy)}: {_setting(runs, best)}"
        return [Row(head, absent=most)]
    return [Row((*head, Cell(name), *_cells(runs, run)), run.technique) for name, run in chosen]


def _by_run(found: Mapping[str, RunRecord | None]) -> list[tuple[str, RunRecord]]:
    """Return (what it is cheapest in, run): one entry where one run is cheapest in both."""
    entries: dict[str, tuple[str, RunRecord]] = {}
    for name, run in found.items():
        if run is not None:
            before = entries.get(run.run_id)
            entries[run.run_id] = (f"{before[0]} and {name}" if before else name, run)
    return list(entries.values())


def _setting(runs: Runs, run: RunRecord) -> str:
    place = place_text(run)
    words = f"{runs.series_of(run).label}, {length_words(run)}"
    return words if place.startswith("pictures") else f"{words}, {place}"


def _cells(runs: Runs, run: RunRecord) -> tuple[Cell, ...]:
    data, time = data_per_answer(run), frame_seconds(run)
    dynamic = "" if run.sequence_length.isdigit() else "mean"
    interval = f"({100 * run.accuracy_low:.0f} to {100 * run.accuracy_high:.0f})"
    return (
        Cell(runs.series_of(run).label, run=run),
        Cell(f"{run.mean_sequence_length:.3g}", run.mean_sequence_length, note=dynamic),
        Cell(
            _compressions(run),
            # Video and descriptors have no c: exports then write their words.
            math.inf
            if run.video or run.descriptor_coding
            else float(max(run.compression_query, run.compression_reference)),
            note=" ".join(run.encoder.split()[2:]),
        ),
        Cell(f"{run.resize} px" if run.resize else "as is", float(run.resize or math.inf)),
        Cell(size_text(data), data, note=_known_before(run)),
        Cell(seconds(time), time),
        Cell(
            percent(run.accuracy),
            run.accuracy,
            note=interval if math.isfinite(run.accuracy_low) else "",
        ),
        Cell(
            f"{run.n_candidates:,}",
            float(run.n_candidates),
            note="few" if run.n_candidates < _FEW else "",
        ),
    )


def _compressions(run: RunRecord) -> str:
    query, reference = run.compression_query, run.compression_reference
    if run.video:
        # That its pictures come in groups, and what the map is, says the run itself.
        said = f"{codec_title(run.video)} crf {run.video_quality}"
    elif query == reference:
        said = compression_text(query)
    else:
        said = f"{compression_text(query)} query, {compression_text(reference)} map"
    if not run.descriptor_coding:
        return said
    # The names of its parameters are in the run itself.
    coding = re.sub(r"\w+=", "", run.descriptor_coding)
    return coding if said == compression_text(-1) else f"{said}, {coding}"
