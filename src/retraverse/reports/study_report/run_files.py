"""What a click on a point opens: one small file for all runs of a condition.

A page that is opened from disk may not fetch data, but it may load a script. Each file is one
call of a function of the page with one value; it is loaded when a run of it is first opened.
"""

import base64
import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from retraverse._version import __version__
from retraverse.datasets import GroundTruth
from retraverse.reports.matrix_figure import matrix_picture
from retraverse.reports.study_report.page_files import put
from retraverse.reports.study_report.picture_files import PictureFiles, Side
from retraverse.reports.study_report.words import (
    dataset_title,
    length_words,
    measured_on,
    number_columns,
    place_text,
)
from retraverse.reports.wording import count
from retraverse.studies.cache import load_matrix
from retraverse.studies.records import RunRecord
from retraverse.studies.selection import (
    Condition,
    condition_of,
    data_per_answer,
    length_of,
    smallest_length,
)
from retraverse.types import Progress

__all__ = ["RunFiles", "run_address"]

Item = TypeVar("Item")

_SETTINGS = (
    ("Technique", "technique"),
    ("Parameters", "technique_parameters"),
    ("Matcher", "matcher"),
    ("Encoder", "encoder"),
    ("Resizer", "resizer"),
    ("Ground truth", "truth"),
    ("Seed", "seed"),
)
_FILES_AT_ONCE = 40
_LIST = "content.json"
"""Beside the run files: which content each was written from, so that it is not written again."""
_MATRIX_CELLS = 240
"""Longest side of a drawn matrix."""


def run_address(run: RunRecord) -> tuple[str, str]:
    """Return the name of a run's file and the run's name in it."""
    text = json.dumps(astuple(condition_of(run)))
    return hashlib.sha256(text.encode()).hexdigest()[:12], run.sequence_length


class RunFiles:
    """Writes the files of all conditions of a study.

    Parameters
    ----------
    out : Path
        The report's folder.
    caches : sequence of Path
        The studies' caches, where the matrices lie.
    pictures : PictureFiles
        Writes the thumbnails.
    in_full : callable
        Reads records with their answers.
    n_lengths : int
        Sequence lengths of a condition whose matches can be stepped through at most.
    n_pictures : int
        Windows of a run that have pictures at most.
    """

    def __init__(
        self,
        out: Path,
        caches: Sequence[Path],
        pictures: PictureFiles,
        in_full: Callable[[Sequence[RunRecord]], Sequence[RunRecord]],
        *,
        n_lengths: int = 6,
        n_pictures: int = 16,
    ) -> None:
        self.out, self.caches, self.pictures, self.in_full = out, caches, pictures, in_full
        self.n_lengths, self.n_pictures = n_lengths, n_pictures

    def write(self, records: Iterable[RunRecord], progress: Progress) -> int:
        """Write the file of every condition; return how many there are."""
        groups: dict[Condition, dict[str, RunRecord]] = {}
        for run in records:
            if run.status == "ok":
                groups.setdefault(condition_of(run), {})[run.sequence_length] = run
        before, now = self._written_before(), {}
        ordered = [sorted(runs.values(), key=_by_length) for runs in groups.values()]
        shown = progress(ordered, total=len(ordered), label="runs of the report")
        for some in _batches(shown, _FILES_AT_ONCE):
            outdated = []
            for runs in some:
                name = run_address(runs[0])[0]
                now[name] = self._content(runs)
                if before.get(name) != now[name]:
                    outdated.append(runs)
            self._write_some(outdated, len(ordered) - len(now) + len(outdated))
        put(self.out / "runs" / _LIST, json.dumps(now, indent=0).encode())
        return len(groups)

    def _write_some(self, groups: Sequence[Sequence[RunRecord]], n_left: int) -> None:
        """Write some of `n_left` files; the long columns of all their runs are read at once."""
        chosen = [_worth_stepping_through(runs, self.n_lengths) for runs in groups]
        whole = iter(self.in_full([run for runs in chosen for run in runs]))
        for at, (runs, picked) in enumerate(zip(groups, chosen, strict=True)):
            self.pictures.grant(n_left - at)
            name = run_address(runs[0])[0]
            data = self._data(runs, list(islice(whole, len(picked))))
            text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
            path = self.out / "runs" / f"{name}.js"
            put(path, f"openedRuns({json.dumps(name)},{text});\n".encode())

    def _content(self, runs: Sequence[RunRecord]) -> str:
        """Return what decides a file, as a hash."""
        has_pictures = self.pictures.source(runs[0].dataset) is not None
        parts = [__version__, has_pictures, self.n_lengths, self.n_pictures]
        parts += [(run.run_id, run.encode_s, run.match_s) for run in runs]
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    def _written_before(self) -> dict[str, str]:
        """Return the hashes of the files that are there already."""
        try:
            known = json.loads((self.out / "runs" / _LIST).read_bytes())
        except (OSError, ValueError):
            return {}
        there = {path.stem for path in (self.out / "runs").glob("*.js")}
        return {name: known[name] for name in known if name in there}

    def _data(self, runs: Sequence[RunRecord], chosen: Sequence[RunRecord]) -> dict[str, Any]:
        truth = self.pictures.truth(runs[0])
        first = chosen[0]
        return {
            "title": _title(first),
            "place": place_text(first),
            "measured": measured_on(first),
            "settings": _settings(first),
            "provenance": _provenance(first),
            "runs": {run.sequence_length: _numbers(run) for run in runs},
            "matches": {run.sequence_length: self._matches(run, truth) for run in chosen},
            "matrix": self._matrix(runs),
            "truth": truth is not None,
        }

    def _matrix(self, runs: Sequence[RunRecord]) -> dict[str, Any] | None:
        key = next((run.similarity_key for run in runs if run.similarity_key), "")
        there = (load_matrix(cache, key) for cache in self.caches if key and cache.is_dir())
        matrix = next((found for found in there if found is not None and found.size), None)
        if matrix is None or matrix.ndim != 2:
            return None
        drawn = matrix_picture(np.asarray(matrix, np.float32), longest=_MATRIX_CELLS)
        return {
            "uri": f"data:image/png;base64,{base64.b64encode(drawn.png).decode()}",
            "shape": drawn.shape,
            "low": _rounded(drawn.low),
            "high": _rounded(drawn.high),
            "block": drawn.block,
        }

    def _matches(self, run: RunRecord, truth: GroundTruth | None) -> dict[str, Any]:
        """Return the answers of a run by columns, and the pictures of some of them."""
        lengths = run.sequence_lengths or ()
        true_frames = _true_frames(run, truth)
        return {
            "q": run.answer_query,
            "r": run.answer_reference,
            "s": [_rounded(score) for score in run.answer_score],
            "c": [int(correct) for correct in run.answer_correct],
            "k": lengths,
            "t": true_frames,
            "p": self._thumbnails(run, true_frames),
        }

    def _thumbnails(self, run: RunRecord, true_frames: Sequence[int]) -> dict[str, Any]:
        """Return, by the place of a window, addresses and names of its three pictures."""
        if self.pictures.source(run.dataset) is None or not run.answer_query:
            return {}
        return {
            str(at): [
                self._thumbnail(run, "query", run.answer_query[at]),
                self._thumbnail(run, "reference", run.answer_reference[at]),
                self._thumbnail(run, "reference", true_frames[at] if true_frames else -1),
            ]
            for at in _worth_seeing(run, self.n_pictures)
        }

    def _thumbnail(self, run: RunRecord, side: Side, frame: int) -> tuple[str, str]:
        """Return address and name of one picture."""
        return (
            self.pictures.address(run, side, frame),
            self.pictures.frame_name(run, side, frame),
        )


def _title(run: RunRecord) -> str:
    matcher = "" if run.matcher == "mean" else f", {run.matcher}"
    return f"{run.technique}{matcher} on {dataset_title(run.dataset)}"


def _by_length(run: RunRecord) -> float:
    return length_of(run) or math.inf


def _batches(items: Iterable[Item], size: int) -> Iterator[list[Item]]:
    remaining = iter(items)
    while batch := list(islice(remaining, size)):
        yield batch


def _worth_stepping_through(runs: Sequence[RunRecord], most: int) -> list[RunRecord]:
    """Return the runs whose matches are kept: the telling lengths first, then even steps."""
    fixed = tuple(run for run in runs if length_of(run) is not None)
    smallest = smallest_length(fixed) if fixed else None
    first = [
        *(run for run in runs if run.sequence_length in ("1", "10", "dynamic")),
        *([smallest.first] if smallest else []),
        *([smallest.stays] if smallest and smallest.stays else []),
        *([max(fixed, key=lambda run: run.accuracy), fixed[-1]] if fixed else []),
    ]
    steps = np.linspace(0, len(runs) - 1, min(most, len(runs))).round().astype(int)
    wanted = {run.sequence_length: run for run in [*first, *(runs[at] for at in steps)]}
    kept = set(list(wanted)[:most])
    return [run for run in runs if run.sequence_length in kept]


def _worth_seeing(run: RunRecord, most: int) -> list[int]:
    """Return places of windows at even steps along the route, half of them wrong if there are."""
    wrong = [at for at, correct in enumerate(run.answer_correct) if not correct]
    chosen = set(_evenly(range(len(run.answer_query)), most - min(len(wrong), most // 2)))
    return sorted(chosen | set(_evenly(wrong, most // 2)))


def _evenly(items: Sequence[int], n: int) -> list[int]:
    if len(items) <= n:
        return list(items)
    return [items[at] for at in np.linspace(0, len(items) - 1, n).round().astype(int)]


def _true_frames(run: RunRecord, truth: GroundTruth | None) -> list[int]:
    """Return the true reference nearest to each answer, -1 = none; empty if truth is not known."""
    if truth is None:
        return []
    found = []
    for query, reference in zip(run.answer_query, run.answer_reference, strict=True):
        positives = truth.positives[query] if query < truth.n_queries else ()
        inside = [int(frame) for frame in positives if frame < run.n_references]
        middle = inside[len(inside) // 2] if inside else -1
        is_one_place = bool(inside) and inside[-1] - inside[0] < len(inside)
        nearest = min(inside, key=lambda frame: abs(frame - reference), default=-1)
        found.append(middle if is_one_place else nearest)
    return found


def _settings(run: RunRecord) -> list[tuple[str, str]]:
    rows = [(name, str(getattr(run, attribute))) for name, attribute in _SETTINGS]
    rows[1] = ("Parameters", _spoken(json.loads(run.technique_parameters)))
    rows.insert(3, ("Pictures", place_text(run)))
    rows += [
        ("Query", count(run.n_queries, "frame")),
        ("Map", count(run.n_references, "frame")),
        ("AUC is", f"definition “{run.auc_definition}”"),
    ]
    return [row for row in rows if row[1]]


def _provenance(run: RunRecord) -> list[tuple[str, str]]:
    values: Mapping[str, Any] = json.loads(run.provenance)
    return [(name.replace("_", " "), _spoken(value)) for name, value in values.items()]


def _spoken(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_spoken(item)}" for name, item in value.items())
    if isinstance(value, list):
        return ", ".join(map(_spoken, value))
    return str(value)


def _numbers(run: RunRecord) -> list[Any]:
    """Return the run's numbers as text, its K in words, and its identity."""
    values = [text for _, text in number_columns(run, data_per_answer(run))]
    return [length_words(run), run.run_id[:16], *values]


def _rounded(value: float) -> float:
    return float(f"{value:.5g}") if math.isfinite(value) else 0.0
