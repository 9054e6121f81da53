"""The list of codings: one entry each."""

from collections.abc import Mapping
from typing import Any, cast

from retraverse.errors import ConfigError
from retraverse.registry import changed_label, read_parameters, unknown_name
from retraverse.techniques.sending.base import Coding
from retraverse.techniques.sending.numbers import Exact, Float16, Int8
from retraverse.techniques.sending.projected import Projected
from retraverse.techniques.sending.sketch import Sketch

__all__ = ["CODINGS", "coding", "coding_label"]

CODINGS: Mapping[str, type[Coding]] = {
    cls.name: cls for cls in (Exact, Float16, Int8, Sketch, Projected)
}
"""Name -> the class of its parameters, from many bytes to few."""


def coding(name: str, **parameters: Any) -> Coding:
    """Return a coding of descriptors by name, with defaults for what is not given.

    Raises
    ------
    ConfigError
        If the coding or a parameter is unknown, or a value out of range.

    Examples
    --------
    >>> coding("sketch", bits=256).bits
    256
    """
    if name not in CODINGS:
        raise ConfigError(unknown_name("coding of descriptors", name, list(CODINGS)))
    return cast(Coding, read_parameters(name, CODINGS[name], parameters))


def coding_label(chosen: Coding) -> str:
    """Return a coding's name, and in brackets the parameters that are not at their defaults."""
    return changed_label(chosen.name, chosen)
