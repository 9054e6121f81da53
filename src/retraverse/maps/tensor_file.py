"""Named arrays in one file, in the safetensors format, written safely and memory-mapped.

The format: eight bytes with the header's length (little-endian), a JSON header that gives each
array's type, shape and place, then the arrays' bytes without gaps. It holds no code, so a
foreign file can at worst be refused. Ours start at multiples of 64 bytes.

Why not the safetensors package: for NumPy its ``get_tensor`` copies (134 MB of file became
131 MB of memory); the mapping here costs no memory and 0.2 ms. The tests read our files with
that package and its files with this module.
"""

import hashlib
import itertools
import json
import math
import mmap
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from retraverse.errors import MapError
from retraverse.maps.files import write_all
from retraverse.types import Array

__all__ = ["FileSeal", "TensorSpecs", "map_tensors", "write_tensors"]

TensorSpecs = Mapping[str, tuple[str, tuple[int | None, ...]]]
"""Array name -> data type and shape; None in a shape = any length."""

ALIGNMENT = 64
LARGEST_HEADER = 1 << 20

_codes = {
    "bool": "BOOL",
    "uint8": "U8",
    "int8": "I8",
    "uint16": "U16",
    "int16": "I16",
    "float16": "F16",
    "uint32": "U32",
    "int32": "I32",
    "float32": "F32",
    "uint64": "U64",
    "int64": "I64",
    "float64": "F64",
}


@dataclass(frozen=True)
class FileSeal:
    """What a file must be, byte for byte."""

    size: int
    """Bytes."""
    sha256: str
    """64 hexadecimal digits."""


def write_tensors(target: int, tensors: Mapping[str, Array]) -> FileSeal:
    """Write arrays to the open file `target` and return its size and checksum.

    Raises
    ------
    OSError
        If the disk is full, say; the file is then incomplete.
    """
    # Wide types first: then every array starts at a multiple of its own width.
    ordered = sorted(tensors.items(), key=lambda item: (-item[1].dtype.itemsize, item[0]))
    digest, size = hashlib.sha256(), 0
    parts = (_bytes_of(array) for _, array in ordered)
    for part in itertools.chain([memoryview(_header(ordered))], parts):
        digest.update(part)
        write_all(target, part)
        size += len(part)
    return FileSeal(size, digest.hexdigest())


def _header(ordered: list[tuple[str, Array]]) -> bytes:
    entries, end = {}, 0
    for name, array in ordered:
        start, end = end, end + array.nbytes
        entries[name] = {
            "dtype": _codes[array.dtype.name],
            "shape": list(array.shape),
            "data_offsets": [start, end],
        }
    text = json.dumps(entries, separators=(",", ":")).encode()
    text += b" " * (-(8 + len(text)) % ALIGNMENT)
    return len(text).to_bytes(8, "little") + text


def _bytes_of(array: Array) -> memoryview:
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return little.reshape(-1).view(np.uint8).data


def map_tensors(
    file: int, seal: FileSeal, specs: TensorSpecs, *, what: str, verify: bool
) -> dict[str, Array]:
    """Return the arrays of an open file, read-only and mapped: pages are read when touched.

    Parameters
    ----------
    file : int
        Open file; may be closed afterwards.
    seal : FileSeal
        What it must be.
    specs : TensorSpecs
        The arrays it must hold, no more and no fewer.
    what : str
        The file's name, for messages.
    verify : bool
        Whether the checksum is compared, which reads all of it; size and header always are.

    Raises
    ------
    MapError
        If the file is not what it must be.
    """
    size = os.fstat(file).st_size
    if size != seal.size:
        short = "truncated" if size < seal.size else "has grown"
        raise MapError(f"{what}: {short}: got {size} bytes, expected {seal.size}; copy it again")
    try:
        mapped = mmap.mmap(file, size, access=mmap.ACCESS_READ)
    except OSError as error:
        # Each mapping keeps its file open: a map of very many segments can meet ``ulimit -n``.
        raise MapError(f"{what}: cannot be mapped into memory: {error.strerror}") from error
    if verify and hashlib.sha256(mapped).hexdigest() != seal.sha256:
        raise MapError(
            f"{what}: its checksum is not the manifest's; edited or damaged, copy it again"
        )
    try:
        return _tensors(mapped, specs)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise MapError(f"{what}: {error}; the file is damaged or foreign") from error


def _tensors(mapped: mmap.mmap, specs: TensorSpecs) -> dict[str, Array]:
    data_start, entries = _read_header(mapped)
    if set(entries) != set(specs):
        raise ValueError(f"holds the arrays {sorted(entries)}, expected {sorted(specs)}")
    tensors, end = {}, 0
    for name, entry in sorted(entries.items(), key=lambda item: item[1]["data_offsets"]):
        array = _tensor(mapped, data_start, name, entry, specs[name])
        if entry["data_offsets"][0] != end:
            raise ValueError(f"array {name!r} does not start where the one before it ends")
        end += array.nbytes
        tensors[name] = array
    if data_start + end != len(mapped):
        raise ValueError(f"arrays end at byte {data_start + end} of {len(mapped)}")
    return tensors


def _read_header(mapped: mmap.mmap) -> tuple[int, dict[str, Any]]:
    length = int.from_bytes(mapped[:8], "little")
    if length > LARGEST_HEADER or 8 + length > len(mapped):
        raise ValueError(f"its header says it is {length} bytes long")
    entries = json.loads(mapped[8 : 8 + length])
    if not isinstance(entries, dict):
        raise ValueError("its header is no table of arrays")
    entries.pop("__metadata__", None)
    return 8 + length, entries


def _tensor(
    mapped: mmap.mmap,
    data_start: int,
    name: str,
    entry: dict[str, Any],
    spec: tuple[str, tuple[int | None, ...]],
) -> Array:
    dtype, expected = spec
    shape, (start, end) = entry["shape"], entry["data_offsets"]
    if not all(type(number) is int and number >= 0 for number in [*shape, start, end]):
        raise ValueError(f"array {name!r} has a size or place that is no count")
    fits = len(shape) == len(expected) and all(
        wanted in (None, got) for got, wanted in zip(shape, expected, strict=True)
    )
    if entry["dtype"] != _codes[dtype] or not fits:
        raise ValueError(
            f"array {name!r} is {entry['dtype']} {shape}, expected {_codes[dtype]} {list(expected)}"
        )
    count = math.prod(shape)
    if end - start != count * np.dtype(dtype).itemsize or data_start + end > len(mapped):
        raise ValueError(f"array {name!r} does not fit its bytes {start} to {end}")
    little = np.dtype(dtype).newbyteorder("<")
    return np.frombuffer(mapped, little, count, data_start + start).reshape(shape)
