"""PyTorch checkpoints (``.pth``, ``.pth.tar``, ``.pt``, ``.ckpt``, ``.torch``) and plain pickles.

Both containers: the zip archive of torch 1.6 and later, and the row of pickles before it. torch
is not used, and nothing in the file is run (`retraverse.weights.readers.pickle_machine`).

Names: a table's keys joined by dots, lists by number. Of a training checkpoint only the network
is read, under its own names: what lies below ``state_dict`` or ``model_state_dict``, not the
optimiser's state beside it. Of a whole pickled module, what its state dict would hold. Plain
settings at the top (``epoch``) go to the metadata.

Source: the notes "Serialization semantics" of the PyTorch documentation, and the container's
layout as torch.save writes it.
"""

import io
import re
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np

from retraverse.errors import InputError
from retraverse.types import Array
from retraverse.weights.readers.guard import Budget, read_member, reading
from retraverse.weights.readers.pickle_machine import Inert, PickleMachine
from retraverse.weights.readers.pickled_values import (
    MAKERS,
    PendingArray,
    Storage,
    StoredTensor,
    is_inert,
    storage_dtype,
    widened,
)
from retraverse.weights.weight_file import WeightFile

__all__ = ["read_legacy", "read_pickle", "read_zip", "recognise_pickle", "recognise_zip"]

_MAGIC = 0x1950A86A20F9469CFC6C
_PROTOCOL = 1001
_GROWTH = 8
"""How much more the tensors may take than the file: some share a storage, half floats are
widened."""
_MOST_VALUES, _DEEPEST = 100_000, 64


def recognise_zip(head: bytes, path: Path) -> bool:
    """Return whether a file is a zip archive; those of NumPy are recognised before."""
    return head[:4] == b"PK\x03\x04"


# Protocols 0 and 1 have no start of their own: a mark, a name, or an empty container.
_old_starts = re.compile(rb"\(|c[\w.]+\n[\w.]+\n|[\]}]q")


def recognise_pickle(head: bytes, path: Path) -> bool:
    """Return whether a file starts like a pickle, torch's row of them included."""
    modern = head[:1] == b"\x80" and head[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05")
    return modern or bool(_old_starts.match(head))


def read_zip(path: Path) -> WeightFile:
    """Read a checkpoint as torch 1.6 and later write it.

    Raises
    ------
    InputError
        If the file is damaged, no checkpoint, or names code.
    """
    with reading(path, "a PyTorch file"), zipfile.ZipFile(path) as archive:
        budget = Budget(path.stat().st_size, _GROWTH)
        members = {member.filename: member for member in archive.infolist()}
        pickles = [name for name in members if re.fullmatch(r"[^/]+/data\.pkl", name)]
        if len(pickles) != 1:
            raise InputError(
                f"{path} is a zip archive without torch's data.pkl: a packed archive? then unpack"
                " it and give the weight file in it"
            )
        folder = pickles[0].removesuffix("data.pkl")

        def content(name: str, n_bytes: int) -> bytes:
            return read_member(archive, members[name], n_bytes, budget)

        marked = f"{folder}byteorder" in members
        order = content(f"{folder}byteorder", 3) if marked else b"lit"
        size = members[pickles[0]].file_size
        root = _machine(budget).load(io.BytesIO(content(pickles[0], size)))

        def row(storage: Storage) -> bytes:
            return content(f"{folder}data/{storage.key}", _n_bytes(storage))

        return _weight_file(root, row, "<" if order == b"lit" else ">", budget, "torch")


def read_pickle(path: Path) -> WeightFile:
    """Read a checkpoint as torch before 1.6 wrote it, or a plain pickle of arrays.

    Raises
    ------
    InputError
        If the file is damaged, or names code.
    """
    with reading(path, "a pickle"):
        # In memory, because reading from a file takes memory for what a length only claims.
        file = io.BytesIO(path.read_bytes())
        budget = Budget(len(file.getbuffer()), _GROWTH)
        first = _machine(budget).load(file)
        if type(first) is int and first == _MAGIC:
            return read_legacy(file, budget)
        return _weight_file(first, _no_row, "<", budget, "pickle")


def read_legacy(file: IO[bytes], budget: Budget) -> WeightFile:
    """Read what follows the magic number: version, machine, values, then the storages."""
    machine = _machine(budget)
    if machine.load(file) != _PROTOCOL:
        raise ValueError("it is of an unknown version of torch's old format")
    system = machine.load(file)
    little = not isinstance(system, dict) or system.get("little_endian", True)
    storages: dict[str, Storage] = {}
    root, keys = _machine(budget, storages).load(file), machine.load(file)
    rows = dict(_legacy_rows(file, keys, storages, budget))

    def row(storage: Storage) -> bytes:
        width = _width(storage.kind)
        start = storage.start * width
        return rows[storage.key][start : start + _n_bytes(storage)]

    return _weight_file(root, row, "<" if little else ">", budget, "torch")


def _legacy_rows(
    file: IO[bytes], keys: Any, storages: dict[str, Storage], budget: Budget
) -> Iterator[tuple[str, bytes]]:
    if not isinstance(keys, list):
        raise ValueError("its list of storages is none")
    for key in keys:
        length = int.from_bytes(file.read(8), "little", signed=True)
        n_bytes = length * _width(storages[str(key)].kind)
        budget.spend(n_bytes)
        content = file.read(n_bytes)
        if len(content) != n_bytes:
            raise ValueError(f"storage {str(key)[:40]} has {len(content)} bytes of {n_bytes}")
        yield str(key), content


def _machine(budget: Budget, storages: dict[str, Storage] | None = None) -> PickleMachine:
    found = {} if storages is None else storages

    def persistent(identity: Any) -> Any:
        value = _persistent(identity)
        if isinstance(value, Storage):
            found[value.key] = value
        return value

    return PickleMachine(MAKERS, is_inert, persistent, budget)


def _persistent(identity: Any) -> Any:
    if not isinstance(identity, tuple) or len(identity) < 2:
        raise ValueError("a pickle refers to something outside of it that is no storage")
    if identity[0] == "module":
        return identity[1]  # Followed by its source code, which nobody needs.
    if identity[0] != "storage" or len(identity) not in (5, 6):
        raise ValueError("a pickle refers to something outside of it that is no storage")
    _, named, key, _, n_elements, *view = identity
    if not isinstance(key, str | int) or type(n_elements) is not int or n_elements < 0:
        raise ValueError("a storage has no name or no size")
    start = 0
    if view and view[0] is not None:
        _, start, n_elements = view[0]
    if type(start) is not int or type(n_elements) is not int or min(start, n_elements) < 0:
        raise ValueError("a storage is no view of another")
    return Storage(storage_dtype(named), str(key), n_elements, start)


def _width(kind: str) -> int:
    return 2 if kind == "bfloat16" else np.dtype(kind).itemsize


def _n_bytes(storage: Storage) -> int:
    return storage.n_elements * _width(storage.kind)


def _no_row(storage: Storage) -> bytes:
    raise ValueError("a plain pickle refers to tensors that are not in it")


def _weight_file(
    root: Any, row: Callable[[Storage], bytes], order: Literal["<", ">"], budget: Budget, kind: str
) -> WeightFile:
    metadata = {}
    if isinstance(root, dict):
        metadata = {str(k): str(v) for k, v in root.items() if _is_setting(v)}
        inner = next((name for name in _network_keys if isinstance(root.get(name), dict)), None)
        if inner is not None:
            root, metadata["read_below"] = root[inner], inner
    rows: dict[str, Array] = {}
    tensors: dict[str, Array] = {}
    for name, value in _Walk().leaves(root, ""):
        if name in tensors:
            raise ValueError(f"the name {name[:80]!r} comes twice")
        if isinstance(value, StoredTensor):
            storage = value.storage
            place = f"{storage.kind}/{storage.key}/{storage.start}/{storage.n_elements}"
            if place not in rows:
                rows[place] = widened(row(storage), storage.kind, order)
            value = value.values(rows[place], budget)
        tensors[name] = value
    if not tensors:
        raise InputError("it holds no tensors")
    return WeightFile(tensors, metadata, kind)


_network_keys = ("state_dict", "model_state_dict")


def _is_setting(value: Any) -> bool:
    return isinstance(value, bool | float) or (
        (isinstance(value, int) and abs(value) < 1 << 62)
        or (isinstance(value, str) and len(value) < 1000)
    )


class _Walk:
    """Finds the arrays in nested values, and gives up where those have no end."""

    def __init__(self) -> None:
        self._seen = 0

    def leaves(
        self, value: Any, name: str, depth: int = 0
    ) -> Iterator[tuple[str, StoredTensor | Array]]:
        self._seen += 1
        if depth > _DEEPEST or self._seen > _MOST_VALUES:
            raise ValueError("its values are nested without end")
        if isinstance(value, PendingArray):
            value = value.array
        if isinstance(value, StoredTensor | np.ndarray):
            yield name or "array", value
        elif isinstance(value, dict):
            yield from self._table(value, name, depth)
        elif isinstance(value, list | tuple):
            yield from self._table(dict(enumerate(value)), name, depth)
        elif isinstance(value, Inert):
            yield from self._object(value, name, depth)

    def _table(
        self, table: dict[Any, Any], name: str, depth: int
    ) -> Iterator[tuple[str, StoredTensor | Array]]:
        for key, value in table.items():
            yield from self.leaves(value, f"{name}.{key}" if name else str(key), depth + 1)

    def _object(
        self, value: Inert, name: str, depth: int
    ) -> Iterator[tuple[str, StoredTensor | Array]]:
        module: dict[Any, Any] = {}
        for part in ("_parameters", "_buffers", "_modules"):
            inner = value.state.get(part)
            module |= inner if isinstance(inner, dict) else {}
        yield from self._table(module or value.state, name, depth)
