"""The list of techniques: every module of this room adds its own."""

import difflib
import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, get_args, get_origin, get_type_hints

from retraverse.errors import ConfigError
from retraverse.techniques.base import Technique

__all__ = ["ParameterInfo", "TechniqueInfo", "register", "technique", "techniques"]


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of a technique, as its dataclass declares it."""

    name: str
    default: Any
    choices: tuple[Any, ...]
    """The values allowed, or empty where a range or type decides."""
    help: str


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


_registry: dict[str, TechniqueInfo] = {}


def register(parameter_class: type) -> Callable[[type], type]:
    """Return a decorator that lists a technique class under its ``name``."""

    def add(cls: type) -> type:
        name: str = cls.name  # type: ignore[attr-defined]
        if name in _registry:
            raise ConfigError(f"two techniques are called {name!r}; names must be unique")
        _registry[name] = TechniqueInfo(
            name=name,
            summary=cls.summary,  # type: ignore[attr-defined]
            citation=cls.citation,  # type: ignore[attr-defined]
            version=cls.version,  # type: ignore[attr-defined]
            parameters=_describe_parameters(parameter_class),
            factory=cls,
            parameter_class=parameter_class,
        )
        return cls

    return add


def techniques() -> list[TechniqueInfo]:
    """Return every technique, sorted by name."""
    _discover()
    return [_registry[name] for name in sorted(_registry)]


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
    _discover()
    if name not in _registry:
        raise ConfigError(_unknown("technique", name, sorted(_registry)))
    info = _registry[name]
    known = {parameter.name for parameter in info.parameters}
    for key in parameters:
        if key not in known:
            raise ConfigError(_unknown(f"parameter of {name}", key, sorted(known)))
    hints = get_type_hints(info.parameter_class)
    values = {key: _read_value(name, key, value, hints[key]) for key, value in parameters.items()}
    return info.factory(info.parameter_class(**values))


def _discover() -> None:
    """Import this room's modules once, so that each adds its techniques."""
    import retraverse.techniques as room

    for module in pkgutil.iter_modules(room.__path__, "retraverse.techniques."):
        importlib.import_module(module.name)


def _describe_parameters(parameter_class: type) -> tuple[ParameterInfo, ...]:
    hints = get_type_hints(parameter_class)
    return tuple(
        ParameterInfo(
            name=field.name,
            default=None if field.default is MISSING else field.default,
            choices=get_args(hints[field.name]) if get_origin(hints[field.name]) is Literal else (),
            help=field.metadata.get("help", ""),
        )
        for field in fields(parameter_class)
    )


def _read_value(technique_name: str, key: str, value: Any, hint: Any) -> Any:
    """Return `value` as the field's type; text is parsed, anything else only checked."""
    what = f"{technique_name} parameter {key!r}: got {value!r}"
    if get_origin(hint) is Literal:
        choices = get_args(hint)
        for choice in choices:
            if value == choice or str(value) == str(choice):
                return choice
        raise ConfigError(f"{what}, expected one of {', '.join(map(repr, choices))}")
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ConfigError(f"{what}, expected {hint.__name__}")
    try:
        number = float(value)
    except ValueError as error:
        raise ConfigError(f"{what}, expected {hint.__name__}") from error
    if hint is int and not number.is_integer():
        raise ConfigError(f"{what}, expected a whole number")
    return hint(number)


def _unknown(what: str, got: str, known: list[str]) -> str:
    close = difflib.get_close_matches(got, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return f"unknown {what}: got {got!r}, expected one of {', '.join(known)}{hint}"
