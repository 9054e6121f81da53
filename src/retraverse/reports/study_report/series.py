"""Which runs make one line, and what the line is called.

A line's name says only what tells it from the other lines of its page: the technique first, then
matcher, parameters, encoder, resizer, seed and sequence length where they differ.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from retraverse.reports.study_report.words import codec_title, compression_text, dataset_order
from retraverse.studies.judging.selection import condition_of
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Place", "Runs", "Series", "SeriesBook", "headline_runs", "is_whole", "place_of"]


MOST_LINES = 16
"""Lines in one figure at most; more cannot be told apart."""


@dataclass(frozen=True, order=True)
class Series:
    """One line."""

    index: int
    """Place in the page's order of lines; colour, mark and dash follow from it."""
    label: str
    technique: str


@dataclass
class SeriesBook:
    """Hands out one `Series` per name, so that a name has one colour all over a page."""

    known: dict[str, Series]

    def get(self, label: str, technique: str) -> Series:
        """Return the series of this name, a new one if it has none yet."""
        if label not in self.known:
            self.known[label] = Series(len(self.known), label, technique)
        return self.known[label]


class Place(NamedTuple):
    """Where on the axes of a study a run lies, sequence length aside."""

    compression_query: int
    compression_reference: int
    resize: int
    video_quality: int = -1
    """Of the video codec the query is sent by, -1 = none."""

    @property
    def is_video(self) -> bool:
        """Say whether the query is sent by a video codec."""
        return self.video_quality >= 0

    @property
    def is_uniform(self) -> bool:
        """Say whether query and map are compressed alike."""
        return not self.is_video and self.compression_query == self.compression_reference

    @property
    def is_mixed(self) -> bool:
        """Say whether query and map are compressed differently, neither as video."""
        return not (self.is_video or self.is_uniform)

    @property
    def query_text(self) -> str:
        """Return what was done to the query pictures: "50", "as is", "crf 36"."""
        if self.is_video:
            return f"crf {self.video_quality}"
        return compression_text(self.compression_query)


def place_of(record: RunRecord) -> Place:
    """Return where on the axes a run lies."""
    return Place(
        record.compression_query,
        record.compression_reference,
        record.resize,
        record.video_quality if record.video else -1,
    )


def is_whole(record: RunRecord) -> bool:
    """Say whether a run's pictures are sent, as JPEG files or as they are.

    No part of JPEG, no video, no descriptors.
    """
    return not (record.jpeg_part or record.video or record.descriptor_coding)


class _Key(NamedTuple):
    technique: str
    parameters: str
    matcher: str
    encoder: str
    jpeg_part: str
    video: str
    group_length: int
    descriptor_coding: str
    resizer: str
    seed: int
    length: str


class Runs:
    """The measured runs of a page, grouped into series, datasets and places.

    Parameters
    ----------
    records : iterable of RunRecord
        Those that failed are left out.
    book : SeriesBook
        The page's.
    over_length : bool
        Whether the figures run along K; otherwise every K asked for is a line of its own.
    """

    def __init__(
        self, records: Iterable[RunRecord], book: SeriesBook, *, over_length: bool = True
    ) -> None:
        self.records = tuple(record for record in records if record.status == "ok")
        self._usual_encoder = _commonest(record.encoder for record in self.records)
        self._usual_resizer = _commonest(record.resizer for record in self.records)
        keys = [self._key(record, over_length) for record in self.records]
        names = _names(sorted(set(keys)))
        for key in sorted(names):
            book.get(names[key], key.technique)
        self._series_of: dict[str, Series] = {}
        found: dict[tuple[Series, str, Place], list[RunRecord]] = {}
        for record, key in zip(self.records, keys, strict=True):
            series = book.get(names[key], record.technique)
            place = place_of(record)
            found.setdefault((series, record.dataset, place), []).append(record)
            self._series_of[record.run_id] = series
        self._found = {group: _by_length(runs) for group, runs in found.items()}
        self.series = sorted({group[0] for group in found})
        self.datasets = sorted({record.dataset for record in self.records}, key=dataset_order)
        self.places = sorted({group[2] for group in found})

    @property
    def drawn(self) -> list[Series]:
        """Return the lines that a figure of lines shows: all, or of many the most accurate."""
        if len(self.series) <= MOST_LINES:
            return self.series
        means = {}
        for series in self.series:
            runs = [
                run for (of, _, _), found in self._found.items() if of == series for run in found
            ]
            means[series] = sum(run.accuracy for run in runs) / len(runs)
        best = sorted(self.series, key=lambda series: -means[series])[:MOST_LINES]
        return sorted(best)

    def _key(self, record: RunRecord, over_length: bool) -> _Key:
        condition = condition_of(record)
        return _Key(
            record.technique,
            condition.parameters,
            record.matcher,
            # Pictures as they are have no encoder: they begin the usual encoder's line.
            record.encoder or self._usual_encoder,
            record.jpeg_part,
            record.video,
            record.group_length,
            record.descriptor_coding,
            record.resizer or self._usual_resizer,
            record.seed,
            "" if over_length else record.sequence_length,
        )

    def at(self, series: Series, dataset: str, place: Place) -> tuple[RunRecord, ...]:
        """Return the runs of one line at one place, by rising K, dynamic last."""
        return self._found.get((series, dataset, place), ())

    def series_of(self, record: RunRecord) -> Series:
        """Return the line that one of these runs belongs to."""
        return self._series_of[record.run_id]

    def places_of(self, series: Series, dataset: str) -> list[Place]:
        """Return the places where a line has runs on a dataset."""
        return sorted(place for s, d, place in self._found if s == series and d == dataset)

    def where(self, test: Callable[[RunRecord], bool]) -> list[RunRecord]:
        """Return the runs that a test accepts."""
        return [record for record in self.records if test(record)]


def headline_runs(records: Sequence[RunRecord], *, at: Sequence[str] = ()) -> list[RunRecord]:
    """Return the runs that stand for their technique where K is no axis.

    Parameters
    ----------
    records : sequence of RunRecord
    at : sequence of str
        Sequence lengths that are always among them where a technique has more than three; by
        default single frames and dynamic lengths, or else K = 10.
    """
    lengths: dict[tuple[str, ...], set[str]] = {}
    for record in records:
        if record.status == "ok":
            lengths.setdefault(_kind(record), set()).add(record.sequence_length)
    kept = {kind: _kept(found, at) for kind, found in lengths.items()}
    return [
        record
        for record in records
        if record.status == "ok" and record.sequence_length in kept[_kind(record)]
    ]


def _kind(record: RunRecord) -> tuple[str, ...]:
    condition = condition_of(record)
    return (
        record.technique,
        condition.parameters,
        record.matcher,
        record.jpeg_part,
        record.video,
        record.descriptor_coding,
    )


def _kept(lengths: set[str], at: Sequence[str]) -> set[str]:
    if len(lengths) <= 3:
        return lengths
    return (
        lengths & set(at)
        or lengths & {"1", "dynamic"}
        or lengths & {"10"}
        or {min(lengths, key=_length_order)}
    )


def _length_order(length: str) -> tuple[bool, int]:
    return (False, int(length)) if length.isdigit() else (True, 0)


def _by_length(runs: list[RunRecord]) -> tuple[RunRecord, ...]:
    unique = {record.sequence_length: record for record in runs}
    return tuple(unique[length] for length in sorted(unique, key=_length_order))


def _commonest(texts: Iterable[str]) -> str:
    counts: dict[str, int] = {}
    for text in texts:
        if text:
            counts[text] = counts.get(text, 0) + 1
    return max(counts, key=lambda text: counts[text], default="")


def _names(keys: Sequence[_Key]) -> dict[_Key, str]:
    """Return a name for every key that tells it from all others."""
    names = {}
    for key in keys:
        alike = [other for other in keys if other.technique == key.technique]
        parts = [key.technique]
        if key.matcher != "mean":
            parts.append(key.matcher)
        parts += _differing(key.parameters, [other.parameters for other in alike])
        if key.jpeg_part:
            parts.append(f"{key.jpeg_part} alone")
        if key.video:
            parts.append(f"{codec_title(key.video)} in groups of {key.group_length}")
        if key.descriptor_coding:
            parts.append(f"sent as {key.descriptor_coding}")
        parts += _encoder_words(key.encoder, {other.encoder for other in keys})
        for name in ("resizer", "seed"):
            if len({getattr(other, name) for other in keys}) > 1:
                text = str(getattr(key, name))
                parts.append(f"seed {text}" if name == "seed" else text)
        if key.length and key.length != "1":
            parts.append("dynamic K" if key.length == "dynamic" else f"K = {key.length}")
        elif key.length and len({other.length for other in alike}) > 1:
            parts.append("K = 1")
        names[key] = ", ".join(part for part in parts if part)
    return names


def _encoder_words(encoder: str, others: set[str]) -> list[str]:
    """Return the words of an encoder that not all encoders have, "plain" if it has none."""
    if len(others) <= 1:
        return []
    common = set.intersection(*(set(other.split()) for other in others))
    own = " ".join(word for word in encoder.split() if word not in common)
    return [f"{own.replace('optimize', 'optimising') or 'plain'} encoder"]


def _differing(parameters: str, others: Sequence[str]) -> list[str]:
    """Return those of the parameters that are not the same everywhere, "name value" each."""
    if len(set(others)) <= 1:
        return []
    mine, all_values = json.loads(parameters), [json.loads(other) for other in set(others)]
    return [
        f"{name} {value}"
        for name, value in mine.items()
        # What a record does not have, its version did not know.
        if any(other.get(name, value) != value for other in all_values)
    ]
