"""What a click on a point shows: numbers, settings, matrix and matches of a condition's runs."""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.datasets import GroundTruth
from retraverse.reports.matrix_figure import matrix_picture
from retraverse.reports.study_report.picture_files import PictureFiles, Side
from retraverse.reports.study_report.words import (
    length_words,
    measured_on,
    number_columns,
    place_text,
    run_name,
)
from retraverse.reports.wording import count
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.cache import load_matrix
from retraverse.studies.keeping.records import RunRecord

__all__ = ["RunData"]

_SETTINGS = (
    ("Technique", "technique"),
    ("Parameters", "technique_parameters"),
    ("Matcher", "matcher"),
    ("Encoder", "encoder"),
    ("Part of JPEG", "jpeg_part"),
    ("Resizer", "resizer"),
    ("Descriptors sent as", "descriptor_coding"),
    ("Ground truth", "truth"),
    ("Seed", "seed"),
)
_MATRIX_CELLS = 240
"""Longest side of a drawn matrix."""


class RunData:
    """Gathers what the page's script is given of a condition; names are short, as in the script.

    Parameters
    ----------
    pictures : PictureFiles
        Writes the thumbnails.
    caches : sequence of Path
        The studies' caches, where the matrices lie.
    n_pictures : int
        Windows of a run that have pictures at most.
    """

    def __init__(self, pictures: PictureFiles, caches: Sequence[Path], n_pictures: int) -> None:
        self._pictures, self._caches, self._n_pictures = pictures, caches, n_pictures

    def of(self, runs: Sequence[RunRecord], chosen: Sequence[RunRecord]) -> dict[str, Any]:
        """Return the data of a condition.

        Parameters
        ----------
        runs : sequence of RunRecord
            All of its runs, light.
        chosen : sequence of RunRecord
            Those whose matches can be stepped through, in full.
        """
        truth = self._pictures.truth(runs[0])
        first = chosen[0]
        return {
            "title": run_name(first),
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
        there = (load_matrix(cache, key) for cache in self._caches if key and cache.is_dir())
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
        if self._pictures.source(run.dataset) is None or not run.answer_query:
            return {}
        return {
            str(at): [
                self._thumbnail(run, "query", run.answer_query[at]),
                self._thumbnail(run, "reference", run.answer_reference[at]),
                self._thumbnail(run, "reference", true_frames[at] if true_frames else -1),
            ]
            for at in _worth_seeing(run, self._n_pictures)
        }

    def _thumbnail(self, run: RunRecord, side: Side, frame: int) -> tuple[str, str]:
        """Return address and name of one picture."""
        return (
            self._pictures.address(run, side, frame),
            self._pictures.frame_name(run, side, frame),
        )


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
