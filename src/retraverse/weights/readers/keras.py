"""Keras models and weights in HDF5: every data set under its path, read with h5py.

Keras 1 and 2 keep weights under ``<layer>/<layer>/<kind>:0``, whole models below
``model_weights``. The names here are the paths in the file without that first step:
``"conv1/conv1/kernel:0"``. Convolution kernels are (height, width, in, out).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.errors import MissingExtraError
from retraverse.types import Array
from retraverse.weights.readers.apart import read_apart
from retraverse.weights.readers.guard import Budget, reading
from retraverse.weights.weight_file import WeightFile

__all__ = [
    "HDF5_START",
    "array_of",
    "datasets_below",
    "open_hdf5",
    "read",
    "read_here",
    "recognise",
]

HDF5_START = b"\x89HDF\r\n\x1a\n"
_GROWTH = 200
"""How much smaller than its content a compressed file may be."""
_DEEPEST = 32


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts like an HDF5 file."""
    return head.startswith(HDF5_START)


def read(path: Path) -> WeightFile:
    """Read every numeric data set of an HDF5 file, in a process of its own.

    Raises
    ------
    InputError
        If the file is damaged.
    MissingExtraError
        If h5py is not installed.
    """
    return read_apart(__name__, path, "a Keras HDF5 file")


def read_here(path: Path) -> WeightFile:
    """Do so in this process, which a damaged file may crash or keep busy for ever."""
    with reading(path, "a Keras HDF5 file"), open_hdf5(path) as file:
        root = file.get("model_weights", file)
        budget = Budget(path.stat().st_size, _GROWTH)
        tensors = {}
        for name, dataset in datasets_below(root):
            if dataset.dtype.kind in "biuf":
                tensors[name] = array_of(dataset, budget)
        metadata = {name: text for name in _attributes if (text := _attribute(file, name))}
    return WeightFile(tensors, metadata, "keras")


def open_hdf5(path: Path) -> Any:
    """Open an HDF5 file with h5py."""
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError(
            "HDF5 files need h5py: pip install 'retraverse[formats]'"
        ) from error
    return h5py.File(path, "r")


def datasets_below(group: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield path and data set of everything below a group, links to other files left alone."""
    import h5py

    if depth > _DEEPEST:
        raise ValueError(f"groups lie more than {_DEEPEST} deep: does one contain itself?")
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        if isinstance(item, h5py.Group):
            yield from datasets_below(item, f"{prefix}{name}/", depth + 1)
        elif isinstance(item, h5py.Dataset):
            yield prefix + name, item


def array_of(dataset: Any, budget: Budget) -> Array:
    """Return a data set's content, within a budget that is asked before memory is."""
    budget.spend(int(np.prod(dataset.shape, dtype=object)) * dataset.dtype.itemsize)
    if dataset.external or dataset.is_virtual:
        raise ValueError(f"{dataset.name} has its values in other files")
    array: Array = np.asarray(dataset[()])
    return array.astype(array.dtype.newbyteorder("="), copy=False)


_attributes = ("keras_version", "backend", "model_config")


def _attribute(file: Any, name: str) -> str:
    value = file.attrs.get(name, "")
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biuf":
        return ""
    return value.decode("utf-8") if isinstance(value, bytes) else str(value)
