"""A reader of pickles that cannot run anything, because it never calls what a pickle names.

A pickle is a program for a machine with a stack and a memo; Python's own machine imports and
calls what the program says, which is how a weight file takes over a computer. This one knows the
same instructions, but a name stays a `Global`, and "call" looks the name up in a short table of
makers of plain values (`retraverse.weights.readers.pickled_values`). A name that is neither there
nor a harmless container is refused when it is met, used or not.

Sizes: every instruction's content lies in the file, and what a maker copies is taken off a
budget. Keys of tables are plain scalars: hashing a deeply nested tuple overflows the C stack.

Source: CPython's module pickletools, which describes every instruction; its `genops` decodes them.
"""

import pickletools
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import IO, Any

from retraverse.errors import InputError
from retraverse.weights.readers.guard import Budget

__all__ = ["Global", "Inert", "Maker", "PickleMachine"]


@dataclass(frozen=True)
class Global:
    """A name that a pickle mentions; never imported."""

    module: str
    name: str

    def __str__(self) -> str:
        """Return the dotted name."""
        return f"{self.module}.{self.name}"


@dataclass(eq=False, repr=False)
class Inert:
    """An object of a class that is not needed: what it was made of, and nothing that runs."""

    kind: Global
    arguments: tuple[Any, ...] = ()
    state: dict[Any, Any] = field(default_factory=dict)


Maker = Callable[[tuple[Any, ...], Budget], Any]
"""Makes a plain value from a call's arguments."""

_MARK = object()


class PickleMachine:
    """Runs one pickle after another from the same file.

    Parameters
    ----------
    makers : mapping of Global to Maker
        What may be called, and what is done in its place.
    is_inert : callable
        Whether a name is a class whose objects may be kept as `Inert`.
    persistent : callable
        What stands for a persistent id, such as a storage of tensors.
    budget : Budget
        Bytes that makers may copy.
    """

    def __init__(
        self,
        makers: Mapping[Global, Maker],
        is_inert: Callable[[Global], bool],
        persistent: Callable[[Any], Any],
        budget: Budget,
    ) -> None:
        self._makers, self._is_inert = makers, is_inert
        self._persistent, self._budget = persistent, budget
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def load(self, file: IO[bytes]) -> Any:
        """Return the value of the pickle at the file's position, which ends up behind it.

        Raises
        ------
        InputError
            If the pickle names something that is not in the tables.
        ValueError, IndexError, KeyError, TypeError
            If it is damaged.
        """
        self._stack, self._memo = [], {}
        with warnings.catch_warnings():
            # Odd escapes in old texts are warned of as if they were in our source.
            warnings.simplefilter("ignore")
            return self._run(file)

    def _run(self, file: IO[bytes]) -> Any:
        for opcode, argument, _ in pickletools.genops(file):
            if opcode.name == "STOP":
                return self._pop()
            step = _steps.get(opcode.name)
            if step is None:
                raise InputError(f"a pickle uses the instruction {opcode.name}, which is not read")
            step(self, argument)
        raise ValueError("a pickle does not end")

    def _push(self, value: Any) -> None:
        self._stack.append(value)

    def _pop(self) -> Any:
        value = self._stack.pop()
        if value is _MARK:
            raise ValueError("a pickle takes a mark for a value")
        return value

    def _top(self) -> Any:
        value = self._stack[-1]
        if value is _MARK:
            raise ValueError("a pickle takes a mark for a value")
        return value

    def _since_mark(self) -> list[Any]:
        values = []
        while (value := self._stack.pop()) is not _MARK:
            values.append(value)
        return values[::-1]

    def _drop(self) -> None:
        self._stack.pop()

    def _drop_to_mark(self) -> None:
        self._since_mark()

    # Containers

    def _append(self, values: list[Any]) -> None:
        target = self._top()
        if not isinstance(target, list):
            raise ValueError("a pickle appends to what is no list")
        target.extend(values)

    def _set_items(self, flat: list[Any]) -> None:
        if len(flat) % 2:
            raise ValueError("a pickle has a key without a value")
        target = self._top()
        table = target.state if isinstance(target, Inert) else target
        if not isinstance(table, dict):
            raise ValueError("a pickle sets items of what is no table")
        for key, value in zip(flat[::2], flat[1::2], strict=True):
            _put(table, key, value)

    def _set_item(self) -> None:
        value, key = self._pop(), self._pop()
        self._set_items([key, value])

    def _push_tuple(self, count: int) -> None:
        values = [self._pop() for _ in range(count)]
        self._push(tuple(values[::-1]))

    def _push_dict(self) -> None:
        flat = self._since_mark()
        self._push({})
        self._set_items(flat)

    # Names and calls

    def _push_global(self, module: Any, name: Any) -> None:
        if not (isinstance(module, str) and isinstance(name, str)):
            raise ValueError("a pickle has a name that is no text")
        named = Global(module, name)
        if named not in self._makers and not self._is_inert(named):
            raise InputError(
                f"a pickle asks for {str(named)[:200]!r}, which would run code; only tensors and"
                " plain values are read: is the file from where you think it is?"
            )
        self._push(named)

    def _call(self, what: Any, arguments: Any) -> None:
        if not isinstance(what, Global) or not isinstance(arguments, tuple):
            raise InputError("a pickle calls what is no known name")
        maker = self._makers.get(what)
        if maker is not None:
            self._push(maker(arguments, self._budget))
        else:
            self._push(Inert(what, arguments))

    def _reduce(self) -> None:
        arguments = self._pop()
        self._call(self._pop(), arguments)

    def _new_with_keywords(self) -> None:
        keywords = self._pop()
        if keywords != {}:
            raise InputError("a pickle calls with keywords, which is not read")
        self._reduce()

    def _object(self) -> None:
        what, *arguments = self._since_mark()
        self._call(what, tuple(arguments))

    def _instance(self, argument: str) -> None:
        self._push_global(*argument.split(" ", 1))
        what = self._pop()
        self._call(what, tuple(self._since_mark()))

    def _build(self) -> None:
        state, target = self._pop(), self._top()
        if hasattr(target, "take_state"):
            target.take_state(state, self._budget)
            return
        # Slots come as a second table.
        parts = state if isinstance(state, tuple) else (state,)
        table = target.state if isinstance(target, Inert) else target
        if not isinstance(table, dict):
            raise ValueError("a pickle gives a state to what has none")
        for part in parts:
            if isinstance(part, dict):
                self._budget.spend(len(part))
                # A table's own attributes, such as a state dict's _metadata, are not its items.
                if isinstance(target, Inert):
                    table.update(part)

    # Memo

    def _memoize(self, index: int | None = None) -> None:
        self._memo[len(self._memo) if index is None else index] = self._top()

    def _recall(self, index: int) -> None:
        self._push(self._memo[index])


def _put(table: dict[Any, Any], key: Any, value: Any) -> None:
    if not isinstance(key, str | int | float | bytes | None):
        raise ValueError(f"a pickle has a key of type {type(key).__name__}, expected a scalar")
    table[key] = value


_Step = Callable[[PickleMachine, Any], None]


def _machine_steps() -> dict[str, _Step]:
    m = PickleMachine
    steps: dict[str, _Step] = dict.fromkeys(("PROTO", "FRAME"), lambda machine, _: None)
    pushed = (
        "INT BININT BININT1 BININT2 LONG LONG1 LONG4 FLOAT BINFLOAT STRING BINSTRING"
        " SHORT_BINSTRING UNICODE BINUNICODE SHORT_BINUNICODE BINUNICODE8 BINBYTES"
        " SHORT_BINBYTES BINBYTES8 BYTEARRAY8"
    )
    steps |= dict.fromkeys(pushed.split(), m._push)
    steps |= {
        "NONE": lambda machine, _: machine._push(None),
        "NEWTRUE": lambda machine, _: machine._push(True),
        "NEWFALSE": lambda machine, _: machine._push(False),
        "MARK": lambda machine, _: machine._push(_MARK),
        "POP": lambda machine, _: machine._drop(),
        "POP_MARK": lambda machine, _: machine._drop_to_mark(),
        "DUP": lambda machine, _: machine._push(machine._top()),
        "EMPTY_LIST": lambda machine, _: machine._push([]),
        "LIST": lambda machine, _: machine._push(machine._since_mark()),
        "APPEND": lambda machine, _: machine._append([machine._pop()]),
        "APPENDS": lambda machine, _: machine._append(machine._since_mark()),
        "EMPTY_TUPLE": lambda machine, _: machine._push(()),
        "TUPLE": lambda machine, _: machine._push(tuple(machine._since_mark())),
        "TUPLE1": lambda machine, _: machine._push_tuple(1),
        "TUPLE2": lambda machine, _: machine._push_tuple(2),
        "TUPLE3": lambda machine, _: machine._push_tuple(3),
        "EMPTY_DICT": lambda machine, _: machine._push({}),
        "DICT": lambda machine, _: machine._push_dict(),
        "SETITEM": lambda machine, _: machine._set_item(),
        "SETITEMS": lambda machine, _: machine._set_items(machine._since_mark()),
        # Sets come as lists: nothing here needs to look things up in them.
        "EMPTY_SET": lambda machine, _: machine._push([]),
        "ADDITEMS": lambda machine, _: machine._append(machine._since_mark()),
        "FROZENSET": lambda machine, _: machine._push(tuple(machine._since_mark())),
        "GLOBAL": lambda machine, argument: machine._push_global(*argument.split(" ", 1)),
        "STACK_GLOBAL": lambda machine, _: machine._push_global(*_swapped(machine)),
        "REDUCE": lambda machine, _: machine._reduce(),
        "NEWOBJ": lambda machine, _: machine._reduce(),
        "NEWOBJ_EX": lambda machine, _: machine._new_with_keywords(),
        "OBJ": lambda machine, _: machine._object(),
        "INST": m._instance,
        "BUILD": lambda machine, _: machine._build(),
        "MEMOIZE": lambda machine, _: machine._memoize(),
        "PERSID": lambda machine, argument: machine._push(machine._persistent(argument)),
        "BINPERSID": lambda machine, _: machine._push(machine._persistent(machine._pop())),
    }
    steps |= dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT"), m._memoize)
    steps |= dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), m._recall)
    return steps


def _swapped(machine: PickleMachine) -> tuple[Any, Any]:
    name, module = machine._pop(), machine._pop()
    return module, name


_steps = _machine_steps()
