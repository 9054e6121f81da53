"""A study's folder: its plan, its records, its cache, and one writer at a time.

::

    plan.toml      the plan, as it was given last
    origin.json    the folder that its paths start from, and the data root, if one was given
    records/       one Parquet file for every few runs; a run is done when its record is here
    superseded/    records of runs that a later plan, or a changed dataset, no longer asks for
    cache/         descriptors and matrices; may lie elsewhere, and may be deleted

Nothing in ``records/`` is ever half-written.
"""

import hashlib
import json
import logging
import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from retraverse.datasets.known import Dataset
from retraverse.errors import InputError
from retraverse.files import write_whole
from retraverse.studies.keeping.records import (
    RunRecord,
    read_index,
    read_records,
    record_files,
    write_records,
)
from retraverse.studies.plans.plan import PlanOrigin, StudyPlan
from retraverse.studies.plans.plan_file import plan_datasets

__all__ = ["StudyFolder", "read_study", "study_datasets"]

logger = logging.getLogger(__name__)

_PLAN, _ORIGIN = "plan.toml", "origin.json"
_Index = tuple[str, str, str, str]


@dataclass
class StudyFolder:
    """A study on disk; see `opened`."""

    path: Path
    n_waiting: int = 0
    """Records that are not on disk yet."""
    _waiting: list[RunRecord] = field(default_factory=list)

    @property
    def records(self) -> Path:
        """Where the records lie."""
        return self.path / "records"

    @property
    def cache(self) -> Path:
        """Where descriptors and matrices lie, unless told otherwise."""
        return self.path / "cache"

    @classmethod
    @contextmanager
    def opened(cls, path: Path) -> Iterator["StudyFolder"]:
        """Hold a study's folder, made if need be, against other writers.

        Raises
        ------
        InputError
            If another process runs this study, or the folder cannot be made.
        """
        folder = cls(path)
        try:
            folder.records.mkdir(parents=True, exist_ok=True)
            lock = os.open(path / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise InputError(f"study {path}: cannot be written to: {error.strerror}") from error
        try:
            _acquire(lock, path)
            for place in (path, folder.records):
                for left_over in place.glob(".*.tmp"):
                    left_over.unlink(missing_ok=True)
            yield folder
        finally:
            os.close(lock)

    def write_plan(self, plan: StudyPlan) -> None:
        """Keep the plan's text beside the records, and where its paths start from."""
        if not plan.text or plan.origin is None:
            return
        write_whole(self.path / _PLAN, plan.text.encode())
        places = {"root": str(plan.origin.root)}
        if plan.origin.data is not None:
            places["data"] = str(plan.origin.data)
        write_whole(self.path / _ORIGIN, json.dumps(places).encode())

    def settle(self, wanted: Collection[str], study: str, chapter: str) -> set[str]:
        """Return the wanted runs that are done; move what is not wanted out of the way.

        Runs that failed, or were missing something, count as not done.
        """
        done: set[str] = set()
        for file in record_files(self.records):
            rows = self._index(file)
            kept = [_is_done(row, wanted, study, chapter) and row[0] not in done for row in rows]
            if not all(kept):
                self._split(file, rows, kept, wanted)
            done.update(row[0] for row, is_kept in zip(rows, kept, strict=True) if is_kept)
        return done

    def add(self, records: Sequence[RunRecord]) -> None:
        """Take records on; they are done after the next `flush`."""
        self._waiting.extend(records)
        self.n_waiting = len(self._waiting)

    def flush(self) -> None:
        """Write the records taken on as one file; InputError if that cannot be."""
        if self._waiting:
            write_records(self.records / _file_name(self._waiting), self._waiting)
        self._waiting.clear()
        self.n_waiting = 0

    def _index(self, file: Path) -> list[_Index]:
        try:
            return read_index(file)
        except InputError as error:
            logger.warning("%s; its runs are done again", error)
            self._put_away(file)
            return []

    def _split(
        self, file: Path, rows: list[_Index], kept: list[bool], wanted: Collection[str]
    ) -> None:
        """Write the rows that stay to a file of their own, and those of other plans to another."""
        if not file.exists():
            return
        records = read_records(file)
        staying = [record for record, is_kept in zip(records, kept, strict=True) if is_kept]
        other = [record for record in records if record.run_id not in wanted]
        if staying:
            write_records(self.records / _file_name(staying), staying)
        if other:
            (self.path / "superseded").mkdir(exist_ok=True)
            write_records(self.path / "superseded" / _file_name(other), other)
        file.unlink()

    def _put_away(self, file: Path) -> None:
        (self.path / "superseded").mkdir(exist_ok=True)
        file.replace(self.path / "superseded" / f"{file.name}.damaged")


def study_datasets(path: Path) -> dict[str, Dataset]:
    """Return the datasets of a study's plan by name, those that are still where they were."""
    try:
        places = json.loads((path / _ORIGIN).read_bytes())
        data = places.get("data")
        origin = PlanOrigin(Path(places["root"]), None if data is None else Path(data))
        found = plan_datasets((path / _PLAN).read_text(encoding="utf-8"), origin)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}  # Made in Python, or by hand: there is nothing to find.
    return {dataset.name: dataset for dataset in found}


def read_study(path: str | os.PathLike[str]) -> tuple[RunRecord, ...]:
    """Return the records of a study's folder, each run once, in the order of their files.

    Raises
    ------
    DataMissingError, InputError
        If there are none, or they are damaged.
    """
    records = read_records(Path(path) / "records")
    return tuple({record.run_id: record for record in records}.values())


def _is_done(row: _Index, wanted: Collection[str], study: str, chapter: str) -> bool:
    run_id, status, of_study, of_chapter = row
    return run_id in wanted and status == "ok" and (of_study, of_chapter) == (study, chapter)


def _file_name(records: Sequence[RunRecord]) -> str:
    """Return a name of its own for every set of runs, whatever the order they came in."""
    runs = "".join(sorted(record.run_id for record in records))
    return f"{hashlib.sha256(runs.encode()).hexdigest()[:24]}.parquet"


def _acquire(lock: int, path: Path) -> None:
    import fcntl

    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"study {path}: another process is running it; wait until it is done, or take another "
            "folder (the cache may be shared)"
        ) from error
