"""Every number of the report: its name, value and definition; and the few that stand on top.

Nothing is computed here: values are read from the record and put into words.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from retraverse.metrics import Evaluation, Interval
from retraverse.reports.wording import (
    NARROW,
    bytes_text,
    count,
    length_text,
    percent,
    plain,
    ratio,
    seconds,
)
from retraverse.studies.comparison_record import ComparisonRecord

__all__ = ["KeyFigure", "Number", "cost_numbers", "key_figures", "quality_numbers"]

_QUALITY: tuple[tuple[str, str, Callable[[float | None], str]], ...] = (
    ("accuracy", "Accuracy", percent),
    ("accuracy_interval", "Accuracy, interval", percent),
    ("accuracy_all_queries", "Accuracy over all queries", percent),
    ("auc", "AUC “thesis”", ratio),
    ("auc_single", "AUC “single”", ratio),
    ("auc_multi", "AUC “multi”", ratio),
    ("average_precision", "Average precision", ratio),
    ("p_r100", "P_R100", percent),
    ("r_p100", "R_P100", percent),
    ("r_p100_single", "R_P100 “single”", percent),
    ("ep", "EP", ratio),
)
"""Attribute of an `Evaluation`, its printed name, and how its values are written."""

_RECALLS = (
    ("recall_at", "Recall@N, all queries"),
    ("recall_at_with_match", "Recall@N, queries with a match"),
)

_COUNTS = (
    ("n_queries", "Query frames"),
    ("n_references", "Reference frames"),
    ("n_with_match", "Query frames with a true match"),
    ("n_answered", "Windows answered"),
    ("n_correct", "Windows answered correctly"),
    ("n_refused", "Windows answered “no match”"),
    ("n_unanswered", "Query frames unanswered"),
)


@dataclass(frozen=True)
class Number:
    """One row of the table of numbers."""

    name: str
    value: str
    definition: str
    single: str = ""
    """The same number for single frames, K = 1."""


@dataclass(frozen=True)
class KeyFigure:
    """One number at the top of the page."""

    label: str
    value: str
    note: str
    """What it is compared with, or what it means, in a few words."""


def quality_numbers(record: ComparisonRecord) -> list[Number]:
    """Return the metrics, each beside its value for single frames; none without truth."""
    result, single = record.evaluation, record.single_frame
    if result is None:
        return []

    def number(key: str, name: str, write: Callable[[Any], str]) -> Number:
        definition = result.definitions[key]
        return Number(name, _text(result, key, write), definition, _text(single, key, write))

    return [
        *(number(*row) for row in _QUALITY),
        *(number(key, name, _recalls) for key, name in _RECALLS if getattr(result, key)),
        *(number(key, name, _whole) for key, name in _COUNTS),
    ]


def _text(result: Evaluation | None, key: str, write: Callable[[Any], str]) -> str:
    """Return one attribute in words; nothing at all where there is no evaluation."""
    if result is None:
        return ""
    value = getattr(result, key)
    return _interval(value) if isinstance(value, Interval) else write(value)


def _interval(interval: Interval) -> str:
    return f"{percent(interval.low)} to {percent(interval.high)}"


def _whole(value: int) -> str:
    return f"{value:,}"


def _recalls(recall: Mapping[int, float] | None) -> str:
    """Return "N = 1: 29.7 %, 5: 65.8 %"; nothing if the matrix was not judged."""
    if not recall:
        return ""
    return "N = " + ", ".join(f"{n}: {percent(value)}" for n, value in recall.items())


def cost_numbers(record: ComparisonRecord) -> list[Number]:
    """Return times and sizes with their definitions."""
    times, size = record.times, record.descriptor_bytes
    mean = plain(times.mean_sequence_length)
    n_references = record.reference.n_frames
    return [
        Number(
            "t_e",
            seconds(times.encode_s),
            "Encoding time: describing one frame on one thread, reading it not counted; mean "
            f"over {count(times.n_timed, 'frame')}. A live stream pays it once per frame.",
        ),
        Number(
            "t_m",
            seconds(times.match_s),
            "Matching time: one query window against the whole map of "
            f"{count(n_references, 'frame')}, descriptors given.",
        ),
        Number(
            "t_VPR",
            seconds(times.vpr_s),
            f"t_e × K + t_m with K = {mean}, the mean sequence length: what one answer costs "
            "when all frames of its window are described anew.",
        ),
        Number(
            "Mean K",
            mean,
            "Sequence length: query frames that are matched together, mean over all windows.",
        ),
        Number(
            "Reading",
            seconds(times.read_s),
            "Reading one picture from disk and decoding it, mean per frame.",
        ),
        Number(
            "Whole run",
            seconds(times.total_s),
            "Wall-clock time from picture files to matches, both traverses, on "
            f"{count(times.threads, 'thread')}.",
        ),
        Number(
            "Descriptor",
            bytes_text(size),
            f"What one frame takes in the map: {record.descriptor_dimension:,} numbers in "
            f"{size:,} bytes, {record.descriptor_kind}.",
        ),
        Number(
            "Map",
            bytes_text(size * n_references),
            f"Descriptors of all {count(n_references, 'reference frame')}.",
        ),
    ]


def key_figures(record: ComparisonRecord) -> list[KeyFigure]:
    """Return the numbers at the top: quality first if it is known, then cost."""
    times, length = record.times, length_text(record)
    return [
        *(_quality_figures(record) if record.evaluation is not None else _answer_figures(record)),
        KeyFigure(
            "Sequence length",
            plain(times.mean_sequence_length),
            length if _is_fixed(record) else f"frames on average; {length}",
        ),
        KeyFigure(
            "Time per answer",
            seconds(times.vpr_s),
            f"t_VPR; {seconds(times.encode_s)} to describe a frame, "
            f"{seconds(times.match_s)} to match",
        ),
        KeyFigure(
            "Map size",
            bytes_text(record.descriptor_bytes * record.reference.n_frames),
            f"{bytes_text(record.descriptor_bytes)} for each of "
            f"{count(record.reference.n_frames, 'frame')}",
        ),
    ]


def _is_fixed(record: ComparisonRecord) -> bool:
    return len(set(record.matches.sequence_length.tolist())) <= 1


def _quality_figures(record: ComparisonRecord) -> list[KeyFigure]:
    result, single = record.evaluation, record.single_frame
    assert result is not None
    interval = result.accuracy_interval
    certainty = f"{100 * interval.level:g}{NARROW}% interval {_interval(interval)}"
    definition = f"definition “{result.curve.definition}”"
    beside = "" if single is None else f"; single frames {percent(single.accuracy)}"
    auc_beside = "" if single is None else f"; single frames {ratio(single.auc)}"
    return [
        KeyFigure("Accuracy", percent(result.accuracy), certainty + beside),
        KeyFigure("AUC", ratio(result.auc), definition + auc_beside),
        KeyFigure(
            "Sure without error",
            percent(result.r_p100),
            "R_P100: recall reached before the first wrong match",
        ),
    ]


def _answer_figures(record: ComparisonRecord) -> list[KeyFigure]:
    matches = record.matches
    n_windows, n_located = len(matches.query), int((matches.reference >= 0).sum())
    return [
        KeyFigure(
            "Located",
            f"{n_located:,}",
            f"of {count(matches.n_queries, 'query frame')}",
        ),
        KeyFigure(
            "No match",
            f"{n_windows - n_located:,}",
            f"of {count(n_windows, 'window')} answered “no match”",
        ),
    ]
