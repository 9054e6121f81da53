"""Helpers for the parameter dataclasses: a default with its help line, and range checks."""

from dataclasses import field, fields
from typing import Any

from retraverse.errors import ConfigError

__all__ = ["check_multiple", "check_range", "parameter", "uncompared_parameters"]


def parameter(default: Any, help: str, *, compared: bool = True) -> Any:
    """Return a dataclass field with a default and the line that lists show.

    Parameters
    ----------
    default : value
    help : str
    compared : bool
        False for what says how a descriptor is computed, not which one: a map made with another
        value is still comparable. Such values are recorded in maps all the same.
    """
    return field(default=default, metadata={"help": help, "compared": compared})


def uncompared_parameters(parameters: Any) -> frozenset[str]:
    """Return the names of the fields of a parameter dataclass that do not change descriptors."""
    return frozenset(
        field.name for field in fields(parameters) if not field.metadata.get("compared", True)
    )


def check_range(name: str, value: float, low: float, high: float, why: str = "") -> None:
    """Raise `ConfigError` unless ``low <= value <= high``; `why` explains the bound."""
    if not low <= value <= high:
        raise ConfigError(f"{name}: got {value:g}, expected {low:g} to {high:g}{why}")


def check_multiple(name: str, value: int, base: int, low: int, high: int) -> None:
    """Raise `ConfigError` unless `value` is a multiple of `base` between `low` and `high`."""
    check_range(name, value, low, high)
    if value % base:
        raise ConfigError(f"{name}: got {value}, expected a multiple of {base}")
