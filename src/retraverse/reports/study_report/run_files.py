"""What a click on a point opens: one small file for all runs of a condition.

A page that is opened from disk may not fetch data, but it may load a script. Each file is one
call of a function of the page with one value; it is loaded when a run of it is first opened.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np

from retraverse._version import __version__
from retraverse.reports.study_report.page_files import put
from retraverse.reports.study_report.picture_files import PictureFiles
from retraverse.reports.study_report.run_data import RunData
from retraverse.studies.judging.selection import (
    Condition,
    condition_of,
    length_of,
    smallest_length,
)
from retraverse.studies.keeping.records import RunRecord
from retraverse.types import Progress

__all__ = ["RunFiles", "run_address"]

Item = TypeVar("Item")

_FILES_AT_ONCE = 40
_LIST = "content.json"
"""Beside the run files: which content each was written from, so that it is not written again."""


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
        self.out, self.pictures, self.in_full = out, pictures, in_full
        self.n_lengths, self.n_pictures = n_lengths, n_pictures
        self._data = RunData(pictures, caches, n_pictures)

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
            data = self._data.of(runs, list(islice(whole, len(picked))))
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
