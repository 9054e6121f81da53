"""What the thesis leads one to expect, tested on the records at hand.

Each expectation is printed as holds or does not hold, with its numbers and its exceptions; the
thesis itself has exceptions to some. Nothing is measured here.

Conventions: c is the JPEG compression in per cent; curves are those of `selection`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Any

from retraverse.studies.judging.selection import (
    Condition,
    Curve,
    condition_of,
    curves_of,
    data_per_answer,
    mean_bytes,
    smallest_length,
)
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Expectation", "check_expectations"]

NETVLAD_BYTES = 16_384
"""NetVLAD's descriptor: 4096 numbers of 4 bytes (16 KB in the thesis, table 6.1)."""
BEYOND = "beyond"
"""Chapter of the runs that the thesis does not have."""
SMALL_PX = 128
"""Below this side ORB is expected to find nothing."""


@dataclass(frozen=True)
class Expectation:
    """One claim, and what the records say to it."""

    name: str
    """Short, for links: ``"accuracy-rises"``."""
    claim: str
    """The expectation, one sentence."""
    holds: bool | None
    """Whether every case agrees; None if no record can tell."""
    numbers: str
    """How many cases agree, and the figures that decide it."""
    exceptions: tuple[str, ...]
    """Every case that does not agree, worst first, one line each."""
    rule: str
    """How a case is decided."""

    @property
    def verdict(self) -> str:
        """Return ``holds``, ``does not hold`` or ``not tested``."""
        return {True: "holds", False: "does not hold", None: "not tested"}[self.holds]


@dataclass(frozen=True)
class _Case:
    """One place where an expectation is tested."""

    agrees: bool
    text: str
    """The case with its numbers."""
    weight: float
    """How far it is from agreeing; larger is worse."""


def check_expectations(records: Iterable[RunRecord]) -> tuple[Expectation, ...]:
    """Return the thesis' expectations, each tested on these records.

    Parameters
    ----------
    records : iterable of RunRecord
        Of any number of chapters; runs that failed are left out, as are those beyond the thesis,
        which expects nothing of them.

    Returns
    -------
    tuple of Expectation
        Always the same six, in the order of the chapters.
    """
    measured = [record for record in records if record.status == "ok" and _is_expected(record)]
    curves = curves_of(measured)
    return tuple(test(measured, curves) for test in _TESTS)


def _is_expected(record: RunRecord) -> bool:
    added = record.jpeg_part or record.video or record.descriptor_coding
    return record.chapter != BEYOND and not added


def _judge(
    name: str, claim: str, rule: str, cases: Sequence[_Case], extra: str = ""
) -> Expectation:
    wrong = sorted((case for case in cases if not case.agrees), key=lambda case: -case.weight)
    agree = len(cases) - len(wrong)
    numbers = f"{agree} of {len(cases)} cases agree" if cases else "no record can tell"
    return Expectation(
        name,
        claim,
        not wrong if cases else None,
        f"{numbers}; {extra}" if extra and cases else numbers,
        tuple(case.text for case in wrong),
        rule,
    )


def _accuracy_rises(_: Sequence[RunRecord], curves: dict[Condition, Curve]) -> Expectation:
    long_enough = {key: curve for key, curve in curves.items() if len(curve) > 1}
    cases = [_rise(key, curve) for key, curve in long_enough.items()]
    ends = [(curve[0].accuracy, curve[-1].accuracy) for curve in long_enough.values()]
    extra = ""
    if ends:
        first, last = (sum(side) / len(ends) for side in zip(*ends, strict=True))
        n_up = sum(end >= start for start, end in ends)
        extra = (
            f"mean accuracy {_percent(first)} at the smallest K, {_percent(last)} at the largest; "
            f"the largest K is at least as accurate as the smallest in {n_up} of {len(ends)}"
        )
    return _judge(
        "accuracy-rises",
        "Accuracy rises with the sequence length K.",
        "One case is one curve: dataset, technique, matcher, compression, size. It agrees if from "
        "no K to the next accuracy falls by more than one window's worth.",
        cases,
        extra,
    )


def _rise(key: Condition, curve: Curve) -> _Case:
    falls = [
        (before.accuracy - after.accuracy, before, after)
        for before, after in pairwise(curve)
        if before.accuracy - after.accuracy > 1.0001 / max(after.n_windows, 1)
    ]
    worst = max(falls, key=lambda fall: fall[0], default=None)
    if worst is None:
        return _Case(True, _name(key), 0)
    fall, before, after = worst
    n_falls = "1 fall" if len(falls) == 1 else f"{len(falls)} falls"
    text = (
        f"{_name(key)}: {n_falls}, the largest {100 * fall:.1f} points from "
        f"K = {before.sequence_length} ({_percent(before.accuracy)}) to "
        f"K = {after.sequence_length} ({_percent(after.accuracy)})"
    )
    return _Case(False, text, fall)


def _bytes_fall(records: Sequence[RunRecord], _: dict[Condition, Curve]) -> Expectation:
    rows = _uniform_pictures(records)
    cases, extra = [], ""
    for name, sizes in _grouped(rows, _pictures_name):
        by_compression = {run.compression_query: mean_bytes(run) for run in sizes}
        if len(by_compression) > 1:
            cases.append(_fall(name, sorted(by_compression.items()), "c", _bytes))
    ratios = [
        min(values.values()) / max(values.values())
        for _, runs in _grouped(rows, _pictures_name)
        if len(values := {run.compression_query: mean_bytes(run) for run in runs}) > 1
    ]
    if ratios:
        extra = (
            f"the smallest pictures are {_percent(min(ratios))} to {_percent(max(ratios))} "
            "of the largest"
        )
    return _judge(
        "bytes-fall",
        "Image bytes fall with the compression c.",
        "One case is one dataset, size and encoder. It agrees if the mean bytes of a picture fall "
        "from each c to the next; pictures as they are do not count.",
        cases,
        extra,
    )


def _smaller_than_descriptor(
    records: Sequence[RunRecord], _: dict[Condition, Curve]
) -> Expectation:
    rows = [run for run in _uniform_pictures(records) if run.compression_query > 50]
    rows = [run for run in rows if run.resize == 256]
    cases = [
        _Case(
            mean_bytes(run) < NETVLAD_BYTES,
            f"{_pictures_name(run)}, c = {run.compression_query}: {_bytes(mean_bytes(run))}",
            mean_bytes(run),
        )
        for run in rows
    ]
    largest = max((mean_bytes(run) for run in rows), default=math.nan)
    return _judge(
        "smaller-than-descriptor",
        "Above c = 50 a picture of 256 px is smaller than NetVLAD's descriptor of 16 KB.",
        f"One case is one dataset and c at 256 px. It agrees if the mean picture takes less than "
        f"{NETVLAD_BYTES:,} bytes.",
        cases,
        f"the largest mean is {_bytes(largest)}",
    )


def _orb_is_blind(records: Sequence[RunRecord], _: dict[Condition, Curve]) -> Expectation:
    rows = _one_each(
        [
            run
            for run in records
            if run.technique == "orb" and run.resize > 0 and not math.isnan(run.no_descriptor_share)
        ],
        lambda run: (run.dataset, run.resize, run.compression_query),
    )
    small = [run for run in rows if run.resize < SMALL_PX]
    cases = [
        _Case(
            run.no_descriptor_share >= 0.5,
            f"{run.dataset}, {run.resize} px: {_percent(run.no_descriptor_share)} of the query "
            "pictures without a keypoint",
            1 - run.no_descriptor_share,
        )
        for run in small
    ]
    by_size = {
        size: sum(run.no_descriptor_share for run in runs) / len(runs)
        for size, runs in _grouped(rows, lambda run: run.resize)
    }
    return _judge(
        "orb-needs-size",
        "ORB finds few or no keypoints below 128 px.",
        "One case is one dataset and size below 128 px. It agrees if at least half of the query "
        "pictures have no keypoint at all.",
        cases,
        "without a keypoint: "
        + ", ".join(f"{size} px {_percent(share)}" for size, share in by_size.items()),
    )


def _time_falls(records: Sequence[RunRecord], _: dict[Condition, Curve]) -> Expectation:
    rows = _one_each(
        [run for run in records if run.resize and math.isfinite(run.vpr_s)],
        lambda run: (replace(condition_of(run), resize=0), run.sequence_length, run.resize),
    )
    cases = []
    for (key, length), runs in _grouped(
        rows, lambda run: (replace(condition_of(run), resize=0), run.sequence_length)
    ):
        by_size = sorted({run.resize: run.vpr_s for run in runs}.items(), reverse=True)
        if len(by_size) > 1:
            name = _name(key) + ("" if length == "1" else f", K = {length}")
            cases.append(_fall(name, by_size, "px", _seconds))
    return _judge(
        "time-falls",
        "t_VPR falls with the resolution.",
        "One case is one dataset and technique. It agrees if t_VPR falls from each size to the "
        "next smaller one.",
        cases,
    )


def _data_fall(_: Sequence[RunRecord], curves: dict[Condition, Curve]) -> Expectation:
    uniform = [
        (replace(key, compression_query=0, compression_reference=0), key, curve)
        for key, curve in curves.items()
        if key.is_uniform and key.compression_query >= 0
    ]
    cases, grown = [], 0
    for name, found in _grouped(uniform, lambda item: item[0]):
        reached = [
            (key.compression_query, smallest.first)
            for _, key, curve in found
            if (smallest := smallest_length(curve)) is not None
        ]
        if len(reached) > 1:
            data = [(c, data_per_answer(run)) for c, run in sorted(reached, key=lambda it: it[0])]
            lengths = {c: run.sequence_length for c, run in reached}
            grown += int(lengths[max(lengths)]) > int(lengths[min(lengths)])
            cases.append(_fall(_name(name), data, "c", _bytes, lengths))
    return _judge(
        "data-fall",
        "The data of an answer, d = mean size x K, fall with c although K grows.",
        "One case is one dataset and technique, query and map compressed alike. K is the smallest "
        "with 100 % accuracy; a c where no K reaches it is left out. It agrees if d falls from "
        "each c to the next.",
        cases,
        f"K is larger at the highest c than at the lowest in {grown} of {len(cases)}",
    )


_TESTS: tuple[Callable[[Sequence[RunRecord], dict[Condition, Curve]], Expectation], ...] = (
    _accuracy_rises,
    _bytes_fall,
    _smaller_than_descriptor,
    _data_fall,
    _orb_is_blind,
    _time_falls,
)


def _fall(
    name: str,
    values: Sequence[tuple[int, float]],
    axis: str,
    write: Callable[[float], str],
    lengths: dict[int, str] | None = None,
) -> _Case:
    """Return the case that `values` fall strictly along their axis."""

    def place(x: int) -> str:
        of_length = f" with K = {lengths[x]}" if lengths else ""
        return f"{axis} = {x}{of_length}" if axis == "c" else f"{x} {axis}"

    rises = [
        ((after[1] - before[1]) / before[1] if before[1] else 0.0, before, after)
        for before, after in pairwise(values)
        if after[1] >= before[1]
    ]
    if not rises:
        return _Case(True, name, 0)
    worst, before, after = max(rises, key=lambda rise: rise[0])
    text = (
        f"{name}: {write(before[1])} at {place(before[0])}, {write(after[1])} at {place(after[0])}"
    )
    return _Case(False, text, worst)


def _uniform_pictures(records: Sequence[RunRecord]) -> list[RunRecord]:
    """Return one run per kind of pictures that were all compressed alike."""
    compressed = [
        run
        for run in records
        if 0 <= run.compression_query == run.compression_reference
        and math.isfinite(mean_bytes(run))
    ]
    return _one_each(compressed, lambda run: (_pictures_name(run), run.compression_query))


def _pictures_name(run: RunRecord) -> str:
    size = f", {run.resize} px" if run.resize else ""
    encoder = f", {run.encoder}" if run.encoder else ""
    return f"{run.dataset}{size}{encoder}"


def _one_each(records: Iterable[RunRecord], key: Callable[[RunRecord], Any]) -> list[RunRecord]:
    """Return the first run of each key, in the order of the keys."""
    first: dict[Any, RunRecord] = {}
    for record in records:
        first.setdefault(key(record), record)
    return [first[name] for name in sorted(first)]


def _grouped(items: Iterable[Any], key: Callable[[Any], Any]) -> list[tuple[Any, list[Any]]]:
    ordered = sorted(items, key=key)
    return [(name, list(group)) for name, group in groupby(ordered, key=key)]


def _name(key: Condition) -> str:
    """Return a condition in words, without what is at its default."""
    parts = [f"{key.technique} on {key.dataset}"]
    if key.matcher != "mean":
        parts.append(key.matcher)
    if key.resize:
        parts.append(f"{key.resize} px")
    if max(key.compression_query, key.compression_reference) > 0:
        parts.append(
            f"c = {key.compression_query}"
            if key.is_uniform
            else f"c = {key.compression_query} query, {key.compression_reference} map"
        )
    return ", ".join(parts)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _bytes(value: float) -> str:
    return f"{value / 1000:,.1f} kB" if value >= 1000 else f"{value:.0f} bytes"


def _seconds(value: float) -> str:
    return f"{1000 * value:.3g} ms" if value < 1 else f"{value:.3g} s"
