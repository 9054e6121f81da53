"""The list of techniques: every module of this room adds its own."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from retraverse.errors import ConfigError
from retraverse.registry import ParameterInfo, Registry, describe_parameters, read_parameters
from retraverse.techniques.base import Technique

__all__ = [
    "CALLABLE_PREFIX",
    "ParameterInfo",
    "TechniqueInfo",
    "register",
    "technique",
    "techniques",
]

CALLABLE_PREFIX = "callable:"
"""Starts the names of techniques that are Python functions: no list can hold those."""


@dataclass(frozen=True)
class TechniqueInfo:
    """One entry of the registry."""

    name: str
    summary: str
    citation: str
    version: int
    parameters: tuple[ParameterInfo, ...]
    factory: Callable[..., Technique]
    parameter_class: type


_registry: Registry[TechniqueInfo] = Registry("technique", "retraverse.techniques")


def register(parameter_class: type) -> Callable[[type], type]:
    """Return a decorator that lists a technique class under its ``name``."""

    def add(cls: type) -> type:
        _registry.add(
            TechniqueInfo(
                name=cls.name,  # type: ignore[attr-defined]
                summary=cls.summary,  # type: ignore[attr-defined]
                citation=cls.citation,  # type: ignore[attr-defined]
                version=cls.version,  # type: ignore[attr-defined]
                parameters=describe_parameters(parameter_class),
                factory=cls,
                parameter_class=parameter_class,
            )
        )
        return cls

    return add


def techniques() -> list[TechniqueInfo]:
    """Return every technique, sorted by name."""
    return _registry.entries()


def technique(name: str, **parameters: Any) -> Technique:
    """Return a technique by name, with the parameters given and defaults for the rest.

    Parameters
    ----------
    name : str
        One of `techniques`.
    **parameters
        Fields of that technique's parameter dataclass. Values may be text, as from a
        command line; they are read as the field's type.

    Raises
    ------
    ConfigError
        If the technique or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> technique("hog", form="chapter7", resolution=64).layout.dimension
    144
    """
    if name.startswith(CALLABLE_PREFIX):
        raise ConfigError(_given_again(name.removeprefix(CALLABLE_PREFIX)))
    info = _registry.entry(name)
    return info.factory(read_parameters(name, info.parameter_class, parameters))


def _given_again(name: str) -> str:
    """Say how a technique that is a function is had again."""
    return (
        f"the technique {name!r} is a Python function, which no map holds: give the same one "
        f"again, technique_from_callable(function, name={name!r}, …), as load_map's technique"
    )
