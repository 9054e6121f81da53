"""The folder of weights on this machine, and the record kept beside each of them.

Layout of the folder (`weights_folder`)
- ``NAME.safetensors``: converted once from whatever was published; names of tensors as published.
- ``NAME.json``: the record: where it came from, checksums of the file as published and of the
  converted one. Where the publisher gives no checksum, this is the pin that later ones must meet.
- ``downloads/``: what is being fetched.
"""

import json
import os
import re
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from retraverse.errors import ConfigError
from retraverse.files import write_whole
from retraverse.weights.checksum import Seal

__all__ = [
    "StoredWeights",
    "check_name",
    "converted_path",
    "is_name",
    "names_in_store",
    "stored_weights",
    "weights_folder",
    "write_record",
]

_SUFFIX = ".safetensors"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True)
class StoredWeights:
    """The record of one entry of the store."""

    name: str
    source: str
    """Address or file it came from."""
    published: Seal
    """The file as it came (of an archive: the file wanted out of it)."""
    converted: Seal
    """The converted file."""
    format: str
    """What it was converted from."""
    stored_at: str
    """UTC, ISO 8601."""
    retraverse: str
    """Version of this package that converted it."""


def weights_folder() -> Path:
    """Return the folder of weights: ``RETRAVERSE_WEIGHTS``, or the platform's cache folder.

    It need not exist.
    """
    chosen = os.environ.get("RETRAVERSE_WEIGHTS")
    if chosen:
        return Path(chosen).expanduser().absolute()
    return _cache_folder() / "retraverse" / "weights"


def _cache_folder() -> Path:
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", str(Path.home() / "AppData" / "Local")))
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def is_name(text: str) -> bool:
    """Tell whether a text can be the name of stored weights: letters, digits, dots, dashes."""
    return _NAME.fullmatch(text) is not None


def check_name(text: str) -> str:
    """Return a name that can be one; ConfigError if it cannot."""
    if not is_name(text):
        raise ConfigError(f"weights name: got {text!r}, expected letters, digits, dots and dashes")
    return text


def converted_path(name: str) -> Path:
    """Return where weights of that name are, or will be, in the store."""
    return weights_folder() / f"{name}{_SUFFIX}"


def names_in_store() -> list[str]:
    """Return the names of all weights, or records of weights, in the store, sorted."""
    folder = weights_folder()
    files = [*folder.glob(f"*{_SUFFIX}"), *folder.glob("*.json")] if folder.is_dir() else []
    return sorted(
        {
            file.name.removesuffix(_SUFFIX).removesuffix(".json")
            for file in files
            if not file.name.startswith(".")
        }
    )


def stored_weights(name: str) -> StoredWeights | None:
    """Return the record of an entry of the store, None if there is none that can be read."""
    try:
        record = json.loads(_record_path(name).read_bytes())
        published, converted = (Seal(**record.pop(key)) for key in ("published", "converted"))
        return StoredWeights(**record, published=published, converted=converted)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def write_record(record: StoredWeights) -> None:
    """Write the record of an entry: whole, or as it was before."""
    write_whole(_record_path(record.name), json.dumps(asdict(record), indent=1).encode())


def _record_path(name: str) -> Path:
    return weights_folder() / f"{name}.json"
