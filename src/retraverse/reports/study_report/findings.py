"""What a page found, in a sentence for each dataset, made from its records."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from retraverse.reports.study_report.chapters.beyond.found import beyond_findings
from retraverse.reports.study_report.choices import cheapest
from retraverse.reports.study_report.series import Runs, SeriesBook, is_whole, place_of
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_title,
    length_words,
    place_text,
    size_text,
)
from retraverse.reports.wording import percent, seconds
from retraverse.studies.judging.selection import data_per_answer, length_of, mean_bytes
from retraverse.studies.keeping.records import RunRecord

__all__ = ["findings", "tells_interval"]


def findings(key: str, records: Sequence[RunRecord]) -> tuple[tuple[str, str], ...]:
    """Return (dataset, what was found) for each dataset of a page, if anything.

    Parameters
    ----------
    key : str
        The page: ``"3"`` to ``"7"``, ``"beyond"`` or ``"runs"``.
    records : sequence of RunRecord
        The page's.
    """
    judged = [run for run in records if math.isfinite(run.accuracy)]
    runs = Runs(judged, SeriesBook({}))
    found = []
    beyond = beyond_findings(judged) if key == "beyond" else {}
    for dataset in runs.datasets:
        here = runs.where(_on(dataset))
        text = beyond.get(dataset) or _FINDINGS.get(key, _free)(_Spoken(runs), here)
        if text:
            found.append((dataset_title(dataset), text))
    return tuple(found)


def tells_interval(text: str) -> bool:
    """Say whether there is an interval in a finding, which must be explained then."""
    return re.search(r"\(\d+ to \d+\)", text) is not None


def _on(dataset: str) -> Callable[[RunRecord], bool]:
    return lambda run: run.dataset == dataset


class _Spoken:
    """Runs in words."""

    def __init__(self, runs: Runs) -> None:
        self.runs = runs

    def name(self, run: RunRecord, *, place: bool = False) -> str:
        """Return "hog, K = 9", and where it is asked for "hog, K = 9, c = 97"."""
        words = self.runs.series_of(run).label
        if run.sequence_length != "1":
            words += f", {_length(run)}"
        # A line of one part of JPEG, or of a coding, has it in its name.
        plain = replace(run, jpeg_part="", descriptor_coding="")
        where = place_text(plain) if place else "pictures"
        return words if where.startswith("pictures") else f"{words}, {where}"

    def full(self, run: RunRecord, *, place: bool = False) -> str:
        """Return a run's name, its accuracy and its time."""
        return (
            f"{self.name(run, place=place)}, with {_interval(run)} and t_VPR {seconds(run.vpr_s)}"
        )


def _length(run: RunRecord) -> str:
    if run.sequence_length.isdigit():
        return length_words(run)
    return f"{run.sequence_length} K (mean {run.mean_sequence_length:.1f})"


def _interval(run: RunRecord) -> str:
    low, high = 100 * run.accuracy_low, 100 * run.accuracy_high
    known = low == low and high == high
    return percent(run.accuracy) + (f" ({low:.0f} to {high:.0f})" if known else "")


def _best(runs: Iterable[RunRecord]) -> RunRecord | None:
    """Return the most accurate run; of equals the fastest."""

    def order(run: RunRecord) -> tuple[float, bool, float, str]:
        timed = run.vpr_s == run.vpr_s
        return -run.accuracy, not timed, run.vpr_s if timed else 0.0, run.run_id

    return min(runs, key=order, default=None)


def _chapter_3(said: _Spoken, here: Sequence[RunRecord]) -> str:
    own = [run for run in here if run.technique == "convsequential"]
    shown = [run for run in own if run.sequence_length in ("10", "dynamic")] or own
    rivals = _best(run for run in here if run.technique != "convsequential")
    mine = _best(shown)
    if mine is None or rivals is None:
        only = mine or rivals
        return f"most accurate is {said.full(only)}." if only else ""
    first, second = (mine, rivals) if mine.accuracy >= rivals.accuracy else (rivals, mine)
    text = f"most accurate is {said.full(first)}; then {said.full(second)}."
    others = [run for run in shown if run is not mine]
    return text + (f" Also {said.full(others[0])}." if others else "")


def _chapter_4(said: _Spoken, here: Sequence[RunRecord]) -> str:
    single = _best(run for run in here if run.sequence_length == "1")
    start = f"of single frames {said.full(single)} is best; " if single else ""
    full = [run for run in here if run.accuracy >= 1 and length_of(run) is not None]
    if not full:
        best = _best(here)
        return f"{start}no K reaches 100 %, the nearest is {said.full(best)}." if best else ""
    shortest = min(full, key=lambda run: (length_of(run) or 0, run.vpr_s))
    fastest = min(full, key=lambda run: (run.vpr_s, length_of(run) or 0))
    text = f"{start}100 % comes first with {said.name(shortest)} (t_VPR {seconds(shortest.vpr_s)})"
    if fastest is shortest:
        return text + ", which also takes the least time."
    return f"{text}, in the least time with {said.name(fastest)} ({seconds(fastest.vpr_s)})."


def _chapter_5(said: _Spoken, here: Sequence[RunRecord]) -> str:
    singles = [run for run in here if run.sequence_length == "1"] or list(here)
    by_step = _by_compression(singles)
    if len(by_step) < 2:
        best = _best(here)
        return f"most accurate is {said.full(best)}." if best else ""
    low, *_, high = sorted(by_step)
    clean, strong = _best(by_step[low]), _best(by_step[high])
    if clean is None or strong is None:
        return ""
    kept = _kept(by_step, clean.accuracy_low)
    shrunk = f"{size_text(mean_bytes(clean))} to {size_text(mean_bytes(strong))} a picture"
    return (
        f"from c = {compression_text(low)} to {high} ({shrunk}) the best falls from "
        f"{percent(clean.accuracy)} ({said.name(clean)}) to {percent(strong.accuracy)} "
        f"({said.name(strong)}). Up to c = {compression_text(kept)} the best stays above "
        f"{percent(clean.accuracy_low)}, the lower end of the interval at "
        f"c = {compression_text(low)}."
    )


def _kept(by_step: Mapping[int, Sequence[RunRecord]], least: float) -> int:
    """Return the last c up to which some run always has at least an accuracy."""
    steps = sorted(by_step)
    kept = steps[0]
    for step in steps:
        if not any(run.accuracy >= least for run in by_step[step]):
            break
        kept = step
    return kept


def _by_compression(runs: Iterable[RunRecord]) -> dict[int, list[RunRecord]]:
    found: dict[int, list[RunRecord]] = {}
    for run in runs:
        if is_whole(run) and place_of(run).is_uniform:
            found.setdefault(run.compression_query, []).append(run)
    return found


def _chapter_6(said: _Spoken, here: Sequence[RunRecord]) -> str:
    by_step = _by_compression(here)
    every = [run for runs in by_step.values() for run in runs]
    least = cheapest(every, 1.0, data_per_answer)
    if least is None:
        best = _best(every)
        return (
            f"no mix reaches 100 %; the nearest is {said.full(best, place=True)}." if best else ""
        )
    text = (
        f"fewest bytes for 100 %: {size_text(data_per_answer(least))} a window by "
        f"{said.name(least, place=True)}, t_VPR {seconds(least.vpr_s)}"
    )
    lowest = min(by_step)
    clean = cheapest(by_step[lowest], 1.0, data_per_answer)
    if clean is None or clean.compression_query == least.compression_query:
        return text + "."
    return (
        f"{text}; at c = {compression_text(lowest)} the fewest are "
        f"{size_text(data_per_answer(clean))} ({said.name(clean)}), "
        f"{data_per_answer(clean) / data_per_answer(least):.1f} times as many."
    )


def _chapter_7(said: _Spoken, here: Sequence[RunRecord]) -> str:
    singles = [run for run in here if run.sequence_length == "1"] or list(here)
    best = _best(singles)
    if best is None:
        return ""
    enough = [run for run in singles if run.resize and run.accuracy >= best.accuracy_low]
    text = f"most accurate is {said.full(best, place=True)}"
    small = min(enough, key=lambda run: (run.resize, -run.accuracy, run.vpr_s), default=best)
    if small.resize == best.resize:
        return f"{text}; no smaller picture is within its interval."
    return f"{text}; within its interval the smallest picture is {said.full(small, place=True)}."


def _free(said: _Spoken, here: Sequence[RunRecord]) -> str:
    best = _best(here)
    return f"most accurate is {said.full(best, place=True)}." if best else ""


_FINDINGS: Mapping[str, Callable[[_Spoken, Sequence[RunRecord]], str]] = {
    "3": _chapter_3,
    "4": _chapter_4,
    "5": _chapter_5,
    "6": _chapter_6,
    "7": _chapter_7,
}
