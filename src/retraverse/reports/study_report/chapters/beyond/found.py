"""What the page beyond the thesis found, in sentences for each dataset."""

import math
from collections.abc import Iterable, Mapping, Sequence

from retraverse.datasets.driven_again import recorded_name
from retraverse.reports.study_report.chapters.beyond.chosen import (
    compared_matchers,
    driven_again,
    read_settings,
)
from retraverse.reports.study_report.chapters.beyond.parts import (
    ALL_PARTS,
    REAL_PARTS,
    PartColumn,
    part_columns,
)
from retraverse.reports.study_report.chapters.beyond.reading import character_distance
from retraverse.reports.study_report.chapters.beyond.sending import sending_cases
from retraverse.reports.study_report.chapters.beyond.video import JPEG, video_cases
from retraverse.reports.study_report.chapters.beyond.ways import WayCase, saved_share
from retraverse.reports.study_report.words import length_words, place_text, size_text
from retraverse.reports.wording import percent, points
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.records import RunRecord
from retraverse.techniques.sending import CODINGS

__all__ = ["beyond_findings"]

_ENOUGH = 0.9
"""Accuracy that counts as recognised beside what can be read."""


def beyond_findings(records: Sequence[RunRecord]) -> Mapping[str, str]:
    """Return what was found on each dataset; those with nothing to say are left out."""
    found: dict[str, list[str]] = {}
    for of_question in (_matchers, _speeds, _parts, _videos, _sending, _reading):
        for dataset, sentence in of_question(records).items():
            found.setdefault(dataset, []).append(sentence)
    return {dataset: _joined(sentences) for dataset, sentences in found.items()}


def _joined(sentences: Sequence[str]) -> str:
    first, *others = sentences
    return " ".join([first, *(text[0].upper() + text[1:] for text in others)])


def _by_dataset(runs: Iterable[RunRecord]) -> dict[str, list[RunRecord]]:
    found: dict[str, list[RunRecord]] = {}
    for run in runs:
        found.setdefault(run.dataset, []).append(run)
    return found


def _matchers(records: Sequence[RunRecord]) -> dict[str, str]:
    return {
        name: _best_matcher(runs) for name, runs in _by_dataset(compared_matchers(records)).items()
    }


def _speeds(records: Sequence[RunRecord]) -> dict[str, str]:
    return {
        name: _best_matcher(runs)
        for name, runs in _by_dataset(driven_again(records)).items()
        if recorded_name(name)[1] != "constant"
    }


def _best_matcher(runs: Sequence[RunRecord]) -> str:
    """Return which matcher answers best where pictures are compressed most."""
    highest = max(run.compression_query for run in runs)
    here = [run for run in runs if run.compression_query == highest]
    means = _by_matcher(here)
    top = max(means.values())
    best = sorted(name for name, mean in means.items() if mean >= top)
    n_techniques = len({(run.technique, run.technique_parameters) for run in here})
    over = f" (mean over {n_techniques} techniques)" if n_techniques > 1 else ""
    where = "pictures as they are" if highest < 0 else f"c = {highest}"
    if len(best) == len(means) > 1:
        return f"at {where} all matchers answer alike, {percent(top)}{over}."
    names = ", ".join(f"“{name}”" for name in best)
    text = f"at {where} {names} answers best, {percent(top)}{over}"
    if len(best) > 1:
        text = f"at {where} {names} answer best, {percent(top)} each{over}"
    if "mean" in best or "mean" not in means:
        return text + "."
    return f"{text}; the thesis' mean of a sequence has {percent(means['mean'])}."


def _by_matcher(runs: Sequence[RunRecord]) -> dict[str, float]:
    """Return the mean accuracy of every matcher that all techniques were matched with."""
    found: dict[str, list[RunRecord]] = {}
    for run in runs:
        found.setdefault(run.matcher, []).append(run)
    most = max(map(len, found.values()))
    return {
        name: sum(run.accuracy for run in of) / len(of)
        for name, of in found.items()
        if len(of) == most
    }


def _parts(records: Sequence[RunRecord]) -> dict[str, str]:
    found: dict[str, list[PartColumn]] = {}
    for column in part_columns(records):
        found.setdefault(column.dataset, []).append(column)
    return {name: _worst_part(columns) for name, columns in found.items()}


def _worst_part(columns: Sequence[PartColumn]) -> str:
    """Return which part alone costs most, on the mean of the techniques with the shortest K."""
    compression = max(one.compression for one in columns)
    here = [one for one in columns if one.compression == compression]
    shortest = min((one.length for one in here), key=lambda length: (len(length), length))
    here = [one for one in here if one.length == shortest]
    shared = set.intersection(*(set(one.damaged) for one in here)) & REAL_PARTS
    if not shared:
        return ""
    means = {name: _mean_change(here, name) for name in shared}
    worst = min(sorted(means), key=lambda name: means[name])
    whole = _mean_change(here, ALL_PARTS)
    beside = "" if math.isnan(whole) else f", all of JPEG {points(whole)}"
    return (
        f"of JPEG's parts at c = {compression} “{worst}” alone changes most: "
        f"{points(means[worst])} points{beside} (K = {shortest}, mean over {len(here)} techniques)."
    )


def _mean_change(columns: Sequence[PartColumn], part: str) -> float:
    return sum(one.change(part) for one in columns) / len(columns)


def _videos(records: Sequence[RunRecord]) -> dict[str, str]:
    said = {name: _saved_of_jpeg(cases) for name, cases in _cases_by_dataset(video_cases(records))}
    return {name: text for name, text in said.items() if text}


def _sending(records: Sequence[RunRecord]) -> dict[str, str]:
    return {
        name: _bytes_of_ways(cases) for name, cases in _cases_by_dataset(sending_cases(records))
    }


def _cases_by_dataset(cases: Iterable[WayCase]) -> Iterable[tuple[str, list[WayCase]]]:
    found: dict[str, list[WayCase]] = {}
    for case in cases:
        found.setdefault(case.dataset, []).append(case)
    return found.items()


def _bytes_of_ways(cases: Sequence[WayCase]) -> str:
    """Return what a window of the longest fixed K weighs in every way, over the techniques."""
    lengths = {case.length for case in cases}
    fixed = {length for length in lengths if length.isdigit()}
    longest = max(fixed or lengths, key=lambda length: (len(length), length))
    here = [case for case in cases if case.length == longest]
    tried = {name for case in here for name in case.by_way}
    # Video is told of by itself.
    words = [f"{name} {_span(name, here)}" for name in (*CODINGS, JPEG) if name in tried]
    return (
        f"a window no worse than with exact descriptors weighs, by technique: {'; '.join(words)} "
        f"(K = {longest})."
    )


def _span(way: str, cases: Sequence[WayCase]) -> str:
    """Return the least and the most bytes, and of how many of the techniques that were tried."""
    tried = [case for case in cases if way in case.by_way]
    runs = [run for case in tried if (run := case.cheapest(way)) is not None]
    if not runs:
        return "none"
    sizes = [data_per_answer(run) for run in runs]
    ends = list(dict.fromkeys(size_text(size) for size in (min(sizes), max(sizes))))
    span = " to ".join(ends)
    return span if len(runs) == len(tried) else f"{span} ({len(runs)} of {len(tried)} techniques)"


def _saved_of_jpeg(cases: Sequence[WayCase]) -> str:
    ways = dict.fromkeys(name for case in cases for name in case.by_way if name != JPEG)
    saved = {
        name: [share for case in cases if math.isfinite(share := saved_share(case, name, JPEG))]
        for name in ways
    }
    words = [
        f"{name} saves {_whole(min(shares))} to {_whole(max(shares))} % of JPEG's bytes"
        for name, shares in saved.items()
        if shares
    ]
    return f"at equal accuracy {'; '.join(words)}." if words else ""


def _whole(share: float) -> str:
    return f"{100 * share:.0f}".replace("-", "\u2212")


def _reading(records: Sequence[RunRecord]) -> dict[str, str]:
    return {name: _least_read(runs) for name, runs in _by_dataset(read_settings(records)).items()}


def _least_read(runs: Sequence[RunRecord]) -> str:
    """Return the pictures in which least can be read of those in which places are recognised."""
    enough = [run for run in runs if run.accuracy >= _ENOUGH]
    if not enough:
        return f"no pictures that were tried leave {100 * _ENOUGH:g} % of the places recognised."
    least = max(enough, key=lambda run: (_height(run), run.accuracy, run.run_id))
    height = _height(least)
    readable = (
        "nothing can be read"
        if math.isinf(height)
        else f"a number plate can be read up to {character_distance(height):.1f} m away"
    )
    return (
        f"in pictures in which {readable} ({place_text(least)}), {least.technique} still "
        f"recognises {percent(least.accuracy)} of the places with {length_words(least)}."
    )


def _height(run: RunRecord) -> float:
    return math.inf if math.isnan(run.legible_height) else run.legible_height
