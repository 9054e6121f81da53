"""Safetensors, read with the package of that name: what every import is converted to."""

from pathlib import Path

from retraverse.weights.readers.guard import reading
from retraverse.weights.weight_file import WeightFile

__all__ = ["read", "read_metadata", "recognise"]

_LARGEST_HEADER = 100_000_000
"""As the format's own library."""


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts with a header's length and a JSON table."""
    length = int.from_bytes(head[:8], "little")
    return head[8:9] == b"{" and 2 <= length <= _LARGEST_HEADER


def read(path: Path) -> WeightFile:
    """Read all arrays of a safetensors file.

    Raises
    ------
    InputError
        If the file is damaged or holds types that NumPy has not (bfloat16).
    """
    from safetensors import SafetensorError, safe_open

    with reading(path, "a safetensors file"):
        try:
            with safe_open(path, framework="np") as file:
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
                return WeightFile(tensors, dict(file.metadata() or {}), "safetensors")
        except SafetensorError as error:
            raise ValueError(str(error)) from error


def read_metadata(path: Path) -> dict[str, str]:
    """Return what a safetensors file says of itself, without its arrays.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    from safetensors import SafetensorError, safe_open

    with reading(path, "a safetensors file"):
        try:
            with safe_open(path, framework="np") as file:
                return dict(file.metadata() or {})
        except SafetensorError as error:
            raise ValueError(str(error)) from error
