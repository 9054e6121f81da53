"""NumPy's ``.npz`` and ``.npy``, without pickle."""

import math
import re
import zipfile
from pathlib import Path

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import Budget, read_member, reading
from retraverse.weights.weight_file import WeightFile

__all__ = ["NPY_START", "read_npy", "read_npz", "recognise_npy", "recognise_npz"]

NPY_START = b"\x93NUMPY"
_GROWTH = 200


def recognise_npz(head: bytes, path: Path) -> bool:
    """Return whether a file is a zip archive of ``.npy`` files."""
    if head[:4] != b"PK\x03\x04":
        return False
    length = int.from_bytes(head[26:28], "little")
    return head[30 : 30 + length].endswith(b".npy")


def recognise_npy(head: bytes, path: Path) -> bool:
    """Return whether a file starts like a ``.npy`` file."""
    return head.startswith(NPY_START)


def read_npz(path: Path) -> WeightFile:
    """Read the arrays of a ``.npz`` file.

    Raises
    ------
    InputError
        If the file is damaged, holds objects (which would need code), or unpacks to far more
        than its size.
    """
    tensors: dict[str, Array] = {}
    with reading(path, "an .npz file"), zipfile.ZipFile(path) as archive:
        budget = Budget(path.stat().st_size, _GROWTH)
        for member in archive.infolist():
            content = read_member(archive, member, member.file_size, budget)
            tensors[member.filename.removesuffix(".npy")] = _array(content)
    return WeightFile(tensors, {}, "npz")


def read_npy(path: Path) -> WeightFile:
    """Read the one array of a ``.npy`` file, under the name ``"array"``.

    Raises
    ------
    InputError
        If the file is damaged or holds objects (which would need code).
    """
    with reading(path, "an .npy file"):
        return WeightFile({"array": _array(path.read_bytes())}, {}, "npz")


def _array(content: bytes) -> Array:
    # NumPy's own reader evaluates the header as Python literals; every one it writes fits this.
    if content[:6] != NPY_START or content[6:7] not in (b"\x01", b"\x02"):
        raise ValueError("an array is in no known version of the .npy format")
    start = 10 if content[6] == 1 else 12
    end = start + int.from_bytes(content[8:start], "little")
    header = _header.fullmatch(content[start:end].decode("latin-1"))
    if header is None:
        raise ValueError("an array's header is damaged, or its type no number (objects need code)")
    dtype, shape = np.dtype(header["dtype"]), _shape(header["shape"])
    values = np.frombuffer(content, dtype, offset=end)
    if math.prod(shape) != values.size:
        raise ValueError(f"an array of shape {shape} has {values.size} values")
    ordered = values.reshape(shape, order="F" if header["fortran"] == "True" else "C")
    return ordered.astype(dtype.newbyteorder("="), order="C")


_header = re.compile(
    r"\{'descr': '(?P<dtype>[|<>](?:b1|[iu][1248]|f[248]|c8|c16))',"
    r" 'fortran_order': (?P<fortran>True|False), 'shape': \((?P<shape>[0-9, ]*)\),? ?\} *\n"
)


def _shape(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in text.replace(",", " ").split())
