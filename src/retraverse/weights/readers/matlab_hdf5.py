"""MATLAB's ``.mat`` files of version 7.3, which are HDF5 files inside, read with h5py.

Names and shapes as `retraverse.weights.readers.matlab` gives them. MATLAB stores arrays with their
axes turned round, cells and arrays of structs as references, and texts as numbers.

Source: MathWorks, "MAT-File Versions"; attributes as MATLAB writes them (``MATLAB_class``).
"""

from pathlib import Path
from typing import Any

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.apart import read_apart
from retraverse.weights.readers.guard import Budget, reading
from retraverse.weights.readers.keras import HDF5_START, array_of, open_hdf5
from retraverse.weights.weight_file import WeightFile

__all__ = ["read", "read_here", "recognise"]

_GROWTH = 200
_DEEPEST, _MOST_VALUES = 32, 100_000


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file is HDF5 behind MATLAB's header."""
    return head[124:128] == b"\x00\x02IM" and head[512:520] == HDF5_START


def read(path: Path) -> WeightFile:
    """Read the arrays of a version 7.3 MAT-file, in a process of its own.

    Raises
    ------
    InputError
        If the file is damaged.
    MissingExtraError
        If h5py is not installed.
    """
    return read_apart(__name__, path, "a MATLAB 7.3 file")


def read_here(path: Path) -> WeightFile:
    """Do so in this process, which a damaged file may crash or keep busy for ever."""
    with reading(path, "a MATLAB 7.3 file"), open_hdf5(path) as file:
        reader = _Reader(file, Budget(path.stat().st_size, _GROWTH))
        for name in file:
            if not name.startswith("#"):
                reader.item(file[name], name, 0)
        if not reader.tensors:
            raise ValueError("it holds no arrays of numbers")
        return WeightFile(reader.tensors, reader.texts, "matlab")


class _Reader:
    """Collects arrays and texts under their full names."""

    def __init__(self, file: Any, budget: Budget) -> None:
        self._file, self._budget, self._seen = file, budget, 0
        self.tensors: dict[str, Array] = {}
        self.texts: dict[str, str] = {}

    def item(self, item: Any, name: str, depth: int) -> None:
        """Collect a group (a struct) or a data set with everything it refers to."""
        import h5py

        self._seen += 1
        if depth > _DEEPEST or self._seen > _MOST_VALUES:
            raise ValueError("its arrays are nested without end")
        if isinstance(item, h5py.Group):
            for field in item:
                self._field(item[field], name, field, depth)
        elif h5py.check_ref_dtype(item.dtype) is not None:
            for i, inner in enumerate(self._referred(item)):
                self.item(inner, f"{name}.{i}", depth + 1)
        elif not item.attrs.get("MATLAB_empty", 0):
            self._values(item, name)

    def _field(self, item: Any, name: str, field: str, depth: int) -> None:
        import h5py

        # In an array of structs each field is a row of references that is no cell.
        several = isinstance(item, h5py.Dataset) and "MATLAB_class" not in item.attrs
        if several and h5py.check_ref_dtype(item.dtype) is not None:
            for i, inner in enumerate(self._referred(item)):
                self.item(inner, f"{name}.{i}.{field}", depth + 1)
        else:
            self.item(item, f"{name}.{field}", depth + 1)

    def _referred(self, item: Any) -> list[Any]:
        # Stored with the axes turned round, so reading on is MATLAB's own order.
        return [self._file[reference] for reference in array_of(item, self._budget).ravel()]

    def _values(self, item: Any, name: str) -> None:
        kind = bytes(item.attrs.get("MATLAB_class", b""))
        values = array_of(item, self._budget)
        if kind == b"char":
            self.texts[name] = "".join(map(chr, values.ravel().tolist()))
        elif kind == b"logical":
            self.tensors[name] = np.ascontiguousarray(values.T.astype(bool))
        elif values.dtype.kind in "iuf":
            self.tensors[name] = np.ascontiguousarray(values.T)
        elif values.dtype.names:
            raise ValueError(f"{name!r} is complex, which is not read")
