"""Reading values out of tables, gathering all that is wrong instead of stopping at the first."""

from collections.abc import Callable
from typing import Any, TypeVar

from retraverse.errors import ConfigError, RetraverseError
from retraverse.registry import unknown_name

__all__ = ["Table", "TableReader"]

Value = TypeVar("Value")
Table = dict[str, Any]


class TableReader:
    """Reads tables; `problems` has one line for each thing that is wrong."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def known_keys(self, where: str, table: Table, known: tuple[str, ...]) -> None:
        """Say which keys are unknown."""
        for key in table:
            if key not in known:
                self.problems.append(unknown_name(f"key in {where}", key, list(known)))

    def value(
        self, key: str, table: Table, kind: type[Value], default: Value, where: str = ""
    ) -> Value:
        """Return the value of a key if it is of one kind, else the default."""
        value = table.get(key, default)
        if isinstance(value, kind) and not (isinstance(value, bool) and kind is int):
            return value
        place = f"{where}: {key}" if where else key
        self.problems.append(f"{place}: got {value!r}, expected {_kind_name(kind)}")
        return default

    def whole(self, key: str, table: Table, default: int, *, least: int) -> int:
        """Return a whole number of at least `least`; ConfigError if it is less."""
        value = self.value(key, table, int, default, "a dataset")
        if value < least:
            raise ConfigError(f"a dataset: {key}: got {value}, expected at least {least}")
        return value

    def listed(
        self,
        key: str,
        table: Table,
        kinds: type | tuple[type, ...],
        default: list[Any] | None = None,
        where: str = "",
    ) -> list[Any]:
        """Return a list of values of some kinds; a single one is a list of one."""
        place = f"{where}.{key}" if where else key
        if key not in table and default is not None:
            return default
        value = table.get(key, [])
        listed = value if isinstance(value, list) else [value]
        if not listed and default != []:
            self.problems.append(f"{place}: got nothing, expected at least one")
        wrong = [item for item in listed if not isinstance(item, kinds) or isinstance(item, bool)]
        for item in wrong:
            self.problems.append(f"{place}: got {item!r}, expected {_kind_name(kinds)}")
        return [item for item in listed if item not in wrong]

    def nothing_twice(self, key: str, names: list[str]) -> None:
        """Say which names are there more than once."""
        for name in sorted({name for name in names if names.count(name) > 1}):
            self.problems.append(f"{key}: {name} is there twice; expected each name once")

    def attempt(self, make: Callable[[], Value]) -> Value | None:
        """Return what is made, or None with the reason among the problems."""
        try:
            return make()
        except (RetraverseError, TypeError, ValueError) as error:
            self.problems.append(str(error))
            return None


def _kind_name(kinds: type | tuple[type, ...]) -> str:
    names = {str: "a text", int: "a whole number", bool: "true or false", dict: "a table"}
    listed = kinds if isinstance(kinds, tuple) else (kinds,)
    return " or ".join(names.get(kind, kind.__name__) for kind in listed)
