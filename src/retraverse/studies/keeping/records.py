"""What one run of a study found: one flat row, kept as Parquet.

Tables, figures and pages are drawn from these rows and nothing else. A row says what was run, on
which pictures, what came out, what it cost and how to repeat it.

Conventions
- A number that does not exist is NaN (null in the file), a whole number -1, a text "".
- Bytes and seconds are per picture where the name does not say otherwise.
- `content_hash` covers what must be the same wherever and whenever a run is repeated: all but
  times, machine and date.
"""

import hashlib
import json
import math
import os
import secrets
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_type_hints

from retraverse.errors import DataMissingError, InputError

__all__ = [
    "NEEDED_COLUMNS",
    "PERISHABLE",
    "RunRecord",
    "Status",
    "read_index",
    "read_records",
    "record_files",
    "write_records",
]

Status = Literal["ok", "failed", "missing"]
"""``ok``: measured; ``failed``: see `error`; ``missing``: its data or weights are not here."""

PERISHABLE = ("encode_s", "match_s", "vpr_s", "coding_s", "compress_s", "similarity_key")
"""Fields that may differ when the same run is repeated: times, and where the matrix was kept."""

PERISHABLE_PROVENANCE = ("machine", "created", "kernel_backend", "versions", "n_timed")
"""Entries of `provenance` that may differ likewise."""


@dataclass(frozen=True)
class RunRecord:
    """One run: one technique, matcher and sequence length on one pair of drives."""

    run_id: str
    """Content hash of all that decides the result: code, settings and pictures; 64 hex digits."""
    study: str
    """Name of the plan."""
    dataset: str
    """Name of the dataset."""
    technique: str
    """Name of the technique."""
    technique_parameters: str = "{}"
    """Every parameter of the technique, JSON."""
    chapter: str = ""
    """Chapter of the thesis the run belongs to, "" if none."""
    matcher: str = "mean"
    """The matcher with the parameters that are not at their defaults."""
    sequence_length: str = "1"
    """K as asked for: ``"10"`` or ``"dynamic"``."""
    mean_sequence_length: float = math.nan
    """Mean K of the windows."""
    compression_query: int = -1
    """c of the query pictures, 0 to 99; -1 = as they are."""
    compression_reference: int = -1
    """c of the reference pictures, 0 to 99; -1 = as they are."""
    encoder: str = ""
    """The JPEG encoder's options, "" where nothing was compressed."""
    jpeg_part: str = ""
    """Which part of JPEG's damage was done, a name of `JPEG_PARTS`; "" = JPEG as it is."""
    video: str = ""
    """The video codec the query was sent by, ``"h265"`` or ``"av1"``; "" = none."""
    video_quality: int = -1
    """Its constant rate factor, larger is coarser; -1 = none."""
    group_length: int = 0
    """Pictures sent as one group of pictures, 0 = none."""
    resize: int = 0
    """Side in pixels the pictures were brought to, 0 = none."""
    resizer: str = ""
    """``"pillow"`` or ``"opencv"``, "" where nothing was resized."""
    seed: int = 0
    """Of the bootstrap interval and of every random choice of the technique."""
    tolerance_frames: int = -1
    """Frames a match may be off, -1 where the truth is not counted in frames."""
    truth: str = ""
    """Where the ground truth comes from and what it tolerates."""
    n_queries: int = 0
    """Frames of the query traverse."""
    n_references: int = 0
    """Frames of the map."""
    n_windows: int = 0
    """Windows that were answered: Q - K + 1 for a fixed K."""
    n_candidates: int = 0
    """Places each window could take: R - K + 1 for a fixed K."""
    accuracy: float = math.nan
    """Correct windows / windows, in [0, 1]."""
    accuracy_low: float = math.nan
    """Lower end of its 95 % bootstrap interval over queries."""
    accuracy_high: float = math.nan
    """Upper end of it."""
    auc: float = math.nan
    """Area under the precision-recall curve, in [0, 1]."""
    auc_definition: str = "thesis"
    """Which curve: ``"thesis"`` counts recall over the correct best matches."""
    p_r100: float = math.nan
    """Precision at full recall, in [0, 1]."""
    r_p100: float = math.nan
    """Recall at full precision, in [0, 1]."""
    ep: float = math.nan
    """Extended precision, in [0, 1]."""
    query_bytes_mean: float = math.nan
    """Mean bytes of a query picture as it was described."""
    reference_bytes_mean: float = math.nan
    """Mean bytes of a reference picture."""
    query_bytes_total: int = -1
    """Bytes of all query pictures."""
    reference_bytes_total: int = -1
    """Bytes of all reference pictures."""
    query_bare_bytes_mean: float = math.nan
    """Mean bytes of a query picture without its constant JPEG tables."""
    entropy_query_mean: float = math.nan
    """Mean entropy of the query pictures, in [0, 1]."""
    legible_height: float = math.nan
    """Smallest height of characters that can be read in query pictures, as a share of their side;
    NaN where it was not measured, or none up to a quarter of the side can be read."""
    descriptor_bytes: int = -1
    """Bytes of one picture's descriptor."""
    descriptor_dimension: int = -1
    """Numbers in it."""
    descriptor_coding: str = ""
    """How the query's descriptors were sent to where the map is; "" = its pictures were sent."""
    coded_bytes: int = -1
    """Bytes of one frame's description as it was sent, all that is compared; -1 where pictures
    were sent. A frame without a descriptor sends none."""
    coding_shared_bytes: int = -1
    """Bytes that both ends must have had before the first descriptor, -1 likewise."""
    no_descriptor_share: float = math.nan
    """Share of query pictures that gave no descriptor at all (ORB on small ones), in [0, 1]."""
    encode_s: float = math.nan
    """t_e: seconds to describe one picture on one thread."""
    match_s: float = math.nan
    """t_m: seconds to match one window against the whole map."""
    vpr_s: float = math.nan
    """t_VPR = t_e K + t_m, seconds; where descriptors are sent t_e has what coding them takes."""
    coding_s: float = math.nan
    """Seconds to write and read one frame's descriptor as it was sent, NaN where pictures were."""
    compress_s: float = math.nan
    """t_c: seconds to resize-and-compress one query picture."""
    sequence_lengths: tuple[int, ...] = ()
    """K of every window where they differ (dynamic); empty for a fixed K."""
    answer_query: tuple[int, ...] = ()
    """Query frame that each window answers for."""
    answer_reference: tuple[int, ...] = ()
    """Reference frame it was given; -1 = "no match"."""
    answer_score: tuple[float, ...] = ()
    """Its score, higher is better."""
    answer_correct: tuple[bool, ...] = ()
    """Whether the truth agrees."""
    similarity_key: str = ""
    """Name of the similarity matrix in the study's cache, "" if it was not kept."""
    status: Status = "ok"
    """``"ok"``, ``"failed"`` or ``"missing"``."""
    error: str = ""
    """Why there is no result, one line."""
    provenance: str = "{}"
    """JSON: versions, parameters, content hashes of query and reference, machine, date."""

    def content_hash(self) -> str:
        """Return the SHA-256 of all that repeating the run must give again, 64 hex digits."""
        steady = {name: _plain(value) for name, value in vars(self).items()}
        for name in PERISHABLE:
            del steady[name]
        provenance = json.loads(self.provenance)
        for name in PERISHABLE_PROVENANCE:
            provenance.pop(name, None)
        steady["provenance"] = provenance
        return hashlib.sha256(json.dumps(steady, sort_keys=True).encode()).hexdigest()


_columns = tuple(field.name for field in fields(RunRecord))
NEEDED_COLUMNS = ("run_id", "study", "dataset", "technique")
"""Without these a file holds no records."""
_parquet_types = {
    int: "BIGINT",
    float: "DOUBLE",
    str: "VARCHAR",
    Status: "VARCHAR",
    tuple[int, ...]: "BIGINT[]",
    tuple[float, ...]: "DOUBLE[]",
    tuple[bool, ...]: "BOOLEAN[]",
}


def write_records(path: str | os.PathLike[str], records: Iterable[RunRecord]) -> None:
    """Write records as one Parquet file, whole or not at all.

    Parameters
    ----------
    path : path
        The file; one that exists is replaced.
    records : iterable of RunRecord

    Raises
    ------
    InputError
        If the file cannot be written (disk full, no such folder); what was there stays.
    """
    place = Path(path)
    temporary = place.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        _copy_to_parquet([vars(record) for record in records], temporary)
        _flush(temporary)
        temporary.replace(place)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) or type(error).__module__.endswith("duckdb"):
            reason = getattr(error, "strerror", None) or _one_line(error)
            raise InputError(f"cannot write records {place}: {reason}") from error
        raise


def read_records(path: str | os.PathLike[str]) -> tuple[RunRecord, ...]:
    """Return the records of a Parquet file, or of all such files in a folder, by their names.

    Raises
    ------
    DataMissingError
        If there is nothing at `path`.
    InputError
        If a file holds no study records, or is damaged.
    """
    place = Path(path)
    if not place.exists():
        raise DataMissingError(f"records {place}: no such file or folder")
    files = record_files(place) if place.is_dir() else (place,)
    return tuple(record for file in files for record in _read_file(file))


def read_index(path: Path) -> list[tuple[str, str, str, str]]:
    """Return (run_id, status, study, chapter) of every record of a file, reading nothing else.

    Raises
    ------
    InputError
        If it holds no study records, or is damaged.
    """
    return [tuple(row) for row in _select("run_id, status, study, chapter", path)]


def record_files(folder: Path) -> tuple[Path, ...]:
    """Return the record files in a folder, sorted by name; half-written ones are hidden."""
    return tuple(sorted(path for path in folder.glob("*.parquet") if path.name[0] != "."))


def _copy_to_parquet(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Hand the rows over as one JSON text: DuckDB reads it faster than rows one by one."""
    text = json.dumps([{name: _plain(value) for name, value in row.items()} for row in rows])
    target = str(path).replace("'", "''")
    _database().execute(
        f"COPY (SELECT unnest(from_json(?, '{_schema()}'), recursive := true)) "
        f"TO '{target}' (FORMAT parquet, COMPRESSION zstd)",
        [text],
    )


def _schema() -> str:
    """Return the columns as DuckDB's `from_json` wants them."""
    hints = get_type_hints(RunRecord)
    kinds = {name: _parquet_types[hints[name]] for name in _columns}
    shapes = {name: [kind[:-2]] if kind.endswith("[]") else kind for name, kind in kinds.items()}
    return json.dumps([shapes])


def _read_file(path: Path) -> list[RunRecord]:
    # Records of an earlier version lack the columns that came later: these keep their defaults.
    there = {row[0] for row in _select("name", path, "parquet_schema")}
    columns = [name for name in _columns if name in there or name in NEEDED_COLUMNS]
    readers = [_readers()[name] for name in columns]
    return [
        RunRecord(
            **{name: read(value) for name, read, value in zip(columns, readers, row, strict=True)}
        )
        for row in _select(", ".join(columns), path)
    ]


def _select(columns: str, path: Path, function: str = "read_parquet") -> list[Any]:
    import duckdb

    try:
        query = f"SELECT {columns} FROM {function}(?)"
        return list(_database().execute(query, [str(path)]).fetchall())
    except duckdb.Error as error:
        raise InputError(
            f"records {path}: no study records in it, or damaged: {_one_line(error)}"
        ) from error


@lru_cache(maxsize=1)
def _readers() -> dict[str, Callable[[Any], Any]]:
    """Return what makes a field of a column's value."""
    hints = get_type_hints(RunRecord)
    return {name: _reader_of(hints[name]) for name in _columns}


def _reader_of(hint: Any) -> Callable[[Any], Any]:
    if hint is float:
        return _number
    if hint == tuple[float, ...]:
        return _numbers
    if _is_list(hint):
        return tuple
    return _same


def _is_list(hint: Any) -> bool:
    return bool(_parquet_types[hint].endswith("[]"))


def _same(value: Any) -> Any:
    return value


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _numbers(values: list[float | None]) -> tuple[float, ...]:
    return tuple(map(_number, values))


def _plain(value: Any) -> Any:
    """Return a field as JSON has it: no NaN, no infinity, no broken characters."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, tuple):
        return [_plain(item) for item in value] if _has_floats(value) else list(value)
    return value


def _has_floats(values: tuple[Any, ...]) -> bool:
    return bool(values) and isinstance(values[0], float)


def _database() -> Any:
    """Return a database in memory that takes one thread and never looks for extensions."""
    global _shared_database
    import duckdb

    if _shared_database is None or _shared_database[0] != os.getpid():
        settings: dict[str, Any] = {
            "threads": 1,
            "autoinstall_known_extensions": False,
            "autoload_known_extensions": False,
        }
        _shared_database = os.getpid(), duckdb.connect(config=settings)
    return _shared_database[1].cursor()


_shared_database: tuple[int, Any] | None = None
"""Process and connection: opening one takes 50 ms, and a forked child must not use its parent's."""


def _flush(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
