"""Descriptors, matrices and picture sizes by the content they were made of.

An entry's *key* is a hash of everything that decides its arrays: code and technique versions,
parameters, weights, what was done to the pictures, and the pictures themselves. So nothing in it
can be out of date, two studies may share one cache, and nothing needs a lock: both would write
the same entry, each whole, and the last one stays.

One entry is one file in the safetensors format, ``<key's first 2>/<key>.safetensors``, with a
checksum over names, shapes and values in its ``__metadata__``. A damaged entry is removed, said,
and made anew.
"""

import hashlib
import json
import logging
import os
import secrets
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.errors import DataMissingError, InputError
from retraverse.types import Array, FloatArray

__all__ = ["CacheEntry", "StudyCache", "content_key", "load_matrix"]

logger = logging.getLogger(__name__)

_types = {
    "F32": "float32",
    "F64": "float64",
    "U8": "uint8",
    "I64": "int64",
    "BOOL": "bool",
    "I8": "int8",
    "U16": "uint16",
    "I16": "int16",
    "F16": "float16",
    "U32": "uint32",
    "I32": "int32",
    "U64": "uint64",
}
_codes = {name: code for code, name in _types.items()}
LARGEST_HEADER = 1 << 20
ALIGNMENT = 64


def content_key(*parts: object) -> str:
    """Return the hash of plain values (text, numbers, lists, dicts), 64 hexadecimal digits."""
    text = json.dumps(parts, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class CacheEntry:
    """Where arrays lie, for a process that can see the same disk."""

    path: Path
    is_checked: bool = False
    """Whether the checksum was compared, or written, a moment ago."""

    def load(self) -> dict[str, Array]:
        """Return its arrays, read-only and mapped.

        Raises
        ------
        InputError
            If it is not there, or damaged.
        """
        return _read(self.path, verify=not self.is_checked)


class StudyCache:
    """A folder of entries by key.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.damaged: list[str] = []
        """Keys of the entries that were found damaged and removed."""
        self._checked: set[str] = set()
        _remove_left_overs(folder)

    def entry(self, key: str) -> CacheEntry:
        """Return where an entry lies, or would lie."""
        return CacheEntry(self.folder / key[:2] / f"{key}.safetensors", key in self._checked)

    def has(self, key: str) -> bool:
        """Return whether there is such an entry; it may turn out damaged."""
        return self.entry(key).path.is_file()

    def load(self, key: str) -> dict[str, Array] | None:
        """Return the arrays of an entry; None if there is none, or it was damaged and removed."""
        path = self.entry(key).path
        try:
            arrays = _read(path, verify=key not in self._checked)
        except DataMissingError:
            return None
        except InputError as error:
            logger.warning("%s; it is made anew", error)
            self.damaged.append(key)
            path.unlink(missing_ok=True)
            return None
        self._checked.add(key)
        return arrays

    def save(self, key: str, arrays: Mapping[str, Array]) -> None:
        """Write an entry, whole or not at all.

        Raises
        ------
        InputError
            If it cannot be written: disk full, folder not ours.
        """
        path = self.entry(key).path
        temporary = path.with_name(f".{_process()}-{secrets.token_hex(6)}.tmp")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Not flushed to the disk: what a power cut leaves behind, the checksum finds.
            with temporary.open("xb", buffering=0) as file:
                for part in _encode(arrays):
                    _write_all(file.fileno(), part)
            temporary.replace(path)
            self._checked.add(key)
        except BaseException as error:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise InputError(
                    f"cache {self.folder}: cannot be written: {error.strerror}; make room and run "
                    "the same command again, it goes on where it stopped"
                ) from error
            raise


def load_matrix(folder: Path, key: str) -> FloatArray | None:
    """Return a run's similarity matrix (Q, R) from a study's cache folder, None if not there."""
    arrays = StudyCache(folder).load(key) if key else None
    return None if arrays is None else arrays.get("similarity")


def _encode(arrays: Mapping[str, Array]) -> list[Any]:
    """Return the parts of a file: header and arrays."""
    ordered = sorted(arrays.items(), key=lambda item: (-item[1].dtype.itemsize, item[0]))
    tables, end = {}, 0
    for name, array in ordered:
        start, end = end, end + array.nbytes
        code, shape = _codes[array.dtype.name], list(array.shape)
        tables[name] = {"dtype": code, "shape": shape, "data_offsets": [start, end]}
    values = [_bytes_of(array) for _, array in ordered]
    seal = {"checksum": _checksum(tables, values)}
    text = json.dumps({"__metadata__": seal, **tables}, separators=(",", ":")).encode()
    text += b" " * (-(8 + len(text)) % ALIGNMENT)
    return [len(text).to_bytes(8, "little") + text, *values]


def _read(path: Path, *, verify: bool) -> dict[str, Array]:
    """Return the arrays of a file, read-only and mapped: pages are read when touched."""
    try:
        content = np.memmap(path, np.uint8, "r") if path.stat().st_size else np.zeros(0, np.uint8)
    except FileNotFoundError as error:
        raise DataMissingError(f"cache entry {path}: not there") from error
    except OSError as error:
        raise InputError(f"cache entry {path}: cannot be read: {error.strerror}") from error
    try:
        return _decode(np.asarray(content), verify)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"cache entry {path} is damaged ({error})") from error


def _decode(content: Array, verify: bool) -> dict[str, Array]:
    length = int.from_bytes(content[:8].tobytes(), "little")
    if length > LARGEST_HEADER or 8 + length > len(content):
        raise ValueError("cut short")
    tables = json.loads(content[8 : 8 + length].tobytes())
    seal = tables.pop("__metadata__")
    data = content[8 + length :]
    if verify and _checksum(tables, [data.data]) != seal["checksum"]:
        raise ValueError("its checksum is another")
    return {name: _array(data, table) for name, table in tables.items()}


def _array(data: Array, table: Mapping[str, Any]) -> Array:
    start, end = table["data_offsets"]
    values = data[start:end].view(np.dtype(_types[table["dtype"]]).newbyteorder("<"))
    return values.reshape(table["shape"])


def _checksum(tables: Mapping[str, Any], values: list[Any]) -> str:
    digest = hashlib.blake2b(json.dumps(tables, sort_keys=True).encode(), digest_size=16)
    for value in values:
        digest.update(value)
    return digest.hexdigest()


def _bytes_of(array: Array) -> memoryview:
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return little.reshape(-1).view(np.uint8).data


def _write_all(file: int, content: Any) -> None:
    left = memoryview(content)
    while left:
        left = left[os.write(file, left) :]


def _process() -> str:
    return f"{socket.gethostname()}-{os.getpid()}"


def _remove_left_overs(folder: Path) -> None:
    """Remove what writers of this machine that no longer live left half-written."""
    for path in folder.glob("??/.*.tmp"):
        host, _, process = path.name[1:].rpartition("-")[0].rpartition("-")
        if host == socket.gethostname() and process.isdigit() and not _lives(int(process)):
            path.unlink(missing_ok=True)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no place in a content key")
