"""The list of matchers: every module of this room adds its own."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from retraverse.matching.matchers.base import Matcher
from retraverse.registry import (
    ParameterInfo,
    Registry,
    changed_label,
    describe_parameters,
    read_parameters,
)

__all__ = ["MatcherInfo", "describe_matcher", "matcher", "matchers", "register"]


@dataclass(frozen=True)
class MatcherInfo:
    """One entry of the registry."""

    name: str
    summary: str
    citation: str
    cost: str
    assumes: str
    frame_by_frame: bool
    parameters: tuple[ParameterInfo, ...]
    factory: Callable[..., Matcher]
    parameter_class: type


_registry: Registry[MatcherInfo] = Registry("matcher", "retraverse.matching.matchers")


def register(parameter_class: type) -> Callable[[type], type]:
    """Return a decorator that lists a matcher class under its ``name``."""

    def add(cls: type) -> type:
        _registry.add(
            MatcherInfo(
                name=cls.name,  # type: ignore[attr-defined]
                summary=cls.summary,  # type: ignore[attr-defined]
                citation=cls.citation,  # type: ignore[attr-defined]
                cost=cls.cost,  # type: ignore[attr-defined]
                assumes=cls.assumes,  # type: ignore[attr-defined]
                frame_by_frame=cls.frame_by_frame,  # type: ignore[attr-defined]
                parameters=describe_parameters(parameter_class),
                factory=cls,
                parameter_class=parameter_class,
            )
        )
        return cls

    return add


def matchers() -> list[MatcherInfo]:
    """Return every matcher, sorted by name."""
    return _registry.entries()


def matcher(name: str, **parameters: Any) -> Matcher:
    """Return a matcher by name, with the parameters given and defaults for the rest.

    Parameters
    ----------
    name : str
        One of `matchers`.
    **parameters
        Fields of that matcher's parameter dataclass. Values may be text, as from a command line.

    Raises
    ------
    ConfigError
        If the matcher or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> matcher("seqslam", index="original").parameters.index
    'original'
    """
    info = _registry.entry(name)
    return info.factory(read_parameters(name, info.parameter_class, parameters))


def describe_matcher(chosen: Matcher) -> str:
    """Return a matcher's name, and in brackets the parameters that are not at their defaults."""
    return changed_label(chosen.name, chosen.parameters)
