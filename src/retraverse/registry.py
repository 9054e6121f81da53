"""Registries: lists of things by name, each with a frozen dataclass of parameters.

Techniques and matchers are listed alike. A module of the room that is listed registers its class;
the room's modules are imported when the list is first asked for, so that nothing else needs to
know of them.
"""

import difflib
import importlib
import os
import pkgutil
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Generic, Literal, Protocol, TypeVar, get_args, get_origin, get_type_hints

from retraverse.errors import ConfigError

__all__ = [
    "Entry",
    "ParameterInfo",
    "Registry",
    "changed_label",
    "describe_parameters",
    "read_parameters",
    "unknown_name",
]


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter, as its dataclass declares it."""

    name: str
    default: Any
    choices: tuple[Any, ...]
    """The values allowed, or empty where a range or type decides."""
    help: str


class Entry(Protocol):
    """What a registry must know of what it lists."""

    @property
    def name(self) -> str:
        """Its name, unique in the registry."""

    @property
    def parameter_class(self) -> type:
        """The frozen dataclass of its parameters."""


EntryType = TypeVar("EntryType", bound=Entry)


class Registry(Generic[EntryType]):
    """A list of entries by name, filled by the modules of one room.

    Parameters
    ----------
    kind : str
        What is listed, for messages: ``"technique"``.
    room : str
        The package whose modules register the entries.
    """

    def __init__(self, kind: str, room: str) -> None:
        self._kind = kind
        self._room = room
        self._entries: dict[str, EntryType] = {}

    def add(self, entry: EntryType) -> None:
        """List an entry; ConfigError if its name is taken."""
        if entry.name in self._entries:
            raise ConfigError(f"two {self._kind}s are called {entry.name!r}; names must be unique")
        self._entries[entry.name] = entry

    def entries(self) -> list[EntryType]:
        """Return every entry, sorted by name."""
        self._discover()
        return [self._entries[name] for name in sorted(self._entries)]

    def entry(self, name: str) -> EntryType:
        """Return one entry; ConfigError names all of them if there is none of that name."""
        self._discover()
        if name not in self._entries:
            raise ConfigError(unknown_name(self._kind, name, sorted(self._entries)))
        return self._entries[name]

    def _discover(self) -> None:
        room = importlib.import_module(self._room)
        for module in pkgutil.iter_modules(room.__path__, f"{self._room}."):
            importlib.import_module(module.name)


def describe_parameters(parameter_class: type) -> tuple[ParameterInfo, ...]:
    """Return what a dataclass of parameters says of each of its fields."""
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


def read_parameters(owner: str, parameter_class: type, values: Mapping[str, Any]) -> Any:
    """Return an instance of `parameter_class`: `values` given, defaults for the rest.

    Values may be text, as from a command line; they are read as the field's type.

    Raises
    ------
    ConfigError
        If a parameter of `owner` is unknown, or a value out of range.
    """
    hints = get_type_hints(parameter_class)
    known = sorted(field.name for field in fields(parameter_class))
    for key in values:
        if key not in known:
            raise ConfigError(unknown_name(f"parameter of {owner}", key, known))
    return parameter_class(
        **{key: _read_value(owner, key, value, hints[key]) for key, value in values.items()}
    )


def changed_label(name: str, parameters: Any) -> str:
    """Return a name, and in brackets the parameters that are not at their defaults."""
    changed = [
        f"{field.name}={getattr(parameters, field.name)}"
        for field in fields(parameters)
        if getattr(parameters, field.name) != field.default
    ]
    return f"{name}({', '.join(changed)})" if changed else name


def unknown_name(what: str, got: str, known: list[str]) -> str:
    """Return the message for a name that is none of `known`, with the nearest of them."""
    close = difflib.get_close_matches(got, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    expected = f"one of {', '.join(known)}" if known else "none"
    return f"unknown {what}: got {got!r}, expected {expected}{hint}"


def _read_value(owner: str, key: str, value: Any, hint: Any) -> Any:
    """Return `value` as the field's type; text is parsed, anything else only checked."""
    what = f"{owner} parameter {key!r}: got {value!r}"
    if get_origin(hint) is Literal:
        choices = get_args(hint)
        for choice in choices:
            if value == choice or str(value) == str(choice):
                return choice
        raise ConfigError(f"{what}, expected one of {', '.join(map(repr, choices))}")
    if hint is str:
        return _read_text(what, value)
    if hint is bool:
        return _read_flag(what, value)
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ConfigError(f"{what}, expected {hint.__name__}")
    try:
        number = float(value)
    except ValueError as error:
        raise ConfigError(f"{what}, expected {hint.__name__}") from error
    if hint is int and not number.is_integer():
        raise ConfigError(f"{what}, expected a whole number")
    return hint(number)


def _read_text(what: str, value: Any) -> str:
    """Return text: as it is, or a path's."""
    if not isinstance(value, str | os.PathLike):
        raise ConfigError(f"{what}, expected text")
    text = os.fspath(value)
    if not isinstance(text, str) or not text.isprintable():
        raise ConfigError(f"{what}, expected printable text")
    return text


def _read_flag(what: str, value: Any) -> bool:
    """Return True or False, from itself or from the words that stand for it."""
    word = str(value).lower()
    if not isinstance(value, bool | str) or word not in _FLAGS:
        raise ConfigError(f"{what}, expected one of {', '.join(_FLAGS)}")
    return _FLAGS[word]


_FLAGS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
