"""Frozen graphs of TensorFlow 1 (``.pb``): constants, and the nodes that use them.

Source: TensorFlow's ``graph.proto``, ``node_def.proto``, ``attr_value.proto``, ``tensor.proto``
and ``types.proto``.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import Budget, reading, whole_content
from retraverse.weights.readers.protobuf import Message
from retraverse.weights.weight_file import WeightFile

__all__ = [
    "AttributeValue",
    "FrozenGraph",
    "GraphNode",
    "parse_frozen_graph",
    "read",
    "read_frozen_graph",
    "recognise",
]

AttributeValue = bool | int | float | str | tuple[int | float | str, ...]


@dataclass(frozen=True)
class GraphNode:
    """One operation of a graph."""

    name: str
    kind: str
    """``Conv2D``, ``FusedBatchNorm``, …"""
    inputs: tuple[str, ...]
    """As in the file: ``name``, ``name:1`` for a further output, ``^name`` for mere order."""
    attributes: Mapping[str, AttributeValue]
    """Settings; data types by their number; tensors are left to `FrozenGraph.constants`."""


@dataclass(frozen=True)
class FrozenGraph:
    """A graph whose variables have become constants."""

    nodes: tuple[GraphNode, ...]
    """Every operation that is no constant, in the file's order."""
    constants: Mapping[str, Array]
    """Node name -> value. Texts are left out."""


_growth = 64
_tensor_types = {
    1: ("float32", 5),
    2: ("float64", 6),
    3: ("int32", 7),
    4: ("uint8", 7),
    5: ("int16", 7),
    6: ("int8", 7),
    9: ("int64", 10),
    10: ("bool", 11),
    19: ("float16", 13),
}
"""DataType -> NumPy's name, and the field of TensorProto that holds single values."""
_STRING = 7


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts with a node: a message that starts with a text."""
    if head[:1] != b"\x0a":
        return False
    lengths = [i for i in range(1, 4) if i < len(head) and head[i] < 128]
    return bool(lengths) and head[lengths[0] + 1 : lengths[0] + 2] == b"\x0a"


def read(path: Path) -> WeightFile:
    """Read the constants; the nodes go to the metadata as JSON."""
    graph = read_frozen_graph(path)
    nodes = json.dumps([asdict(node) for node in graph.nodes])
    return WeightFile(graph.constants, {"graph": nodes}, "tensorflow")


def read_frozen_graph(path: Path) -> FrozenGraph:
    """Read constants and nodes of a frozen graph.

    Raises
    ------
    InputError
        If the file is none or damaged.
    """
    with reading(path, "a frozen TensorFlow graph"):
        return parse_frozen_graph(whole_content(path))


def parse_frozen_graph(content: memoryview) -> FrozenGraph:
    """Return what `read_frozen_graph` returns from a file's bytes.

    Raises
    ------
    ValueError
        If they are no frozen graph.
    """
    budget = Budget(len(content), _growth)
    nodes, constants = [], {}
    for message in Message(content).messages(1):
        name, attributes = message.text(1), _attributes(message)
        if message.text(2) != "Const":
            nodes.append(_node(message, attributes))
            continue
        if name in constants:
            raise ValueError(f"the name {name[:80]!r} comes twice")
        tensor = attributes["value"].message(8)
        if tensor.integer(1) != _STRING:
            constants[name] = _tensor(tensor, budget)
    if not constants:
        raise ValueError("it has no constants; was it frozen?")
    return FrozenGraph(tuple(nodes), constants)


def _attributes(node: Message) -> dict[str, Message]:
    return {entry.text(1): entry.message(2) for entry in node.messages(5)}


def _node(node: Message, attributes: Mapping[str, Message]) -> GraphNode:
    values = {name: _value(message) for name, message in attributes.items()}
    known = {name: value for name, value in values.items() if value is not None}
    return GraphNode(node.text(1), node.text(2), tuple(node.texts(3)), known)


def _value(value: Message) -> AttributeValue | None:
    if 1 in value:
        return _list(value.message(1))
    if 2 in value:
        return bytes(value.content(2)).decode("latin-1")
    if 4 in value:
        return float(value.reals(4, np.float32)[-1])
    if 5 in value:
        return bool(value.integer(5))
    if 7 in value:
        return _dims(value.message(7))
    return next((value.integer(number) for number in (3, 6) if number in value), None)


def _list(values: Message) -> tuple[int | float | str, ...]:
    if 2 in values:
        return tuple(values.texts(2))
    if 4 in values:
        return tuple(values.reals(4, np.float32).tolist())
    return tuple(next((values.integers(n).tolist() for n in (3, 5, 6) if n in values), []))


def _dims(shape: Message) -> tuple[int, ...]:
    return tuple(dim.integer(1) for dim in shape.messages(2))


def _tensor(tensor: Message, budget: Budget) -> Array:
    number = tensor.integer(1)
    if number not in _tensor_types:
        raise ValueError(f"a constant has the data type {number}, expected plain numbers")
    (name, field), shape = _tensor_types[number], _dims(tensor.message(2))
    dtype = np.dtype(name)
    if min(shape, default=0) < 0:
        raise ValueError(f"a constant has the shape {shape}")
    budget.spend(math.prod(shape) * dtype.itemsize)
    content = tensor.content(4)
    if len(content):
        return np.frombuffer(content, dtype.newbyteorder("<")).astype(dtype).reshape(shape)
    values = _single_values(tensor, field, dtype)
    # Fewer values than places: the last one fills the rest; none at all are zeros.
    filled = np.zeros(math.prod(shape), dtype)
    if values.size > filled.size:
        raise ValueError(f"a constant of shape {shape} has {values.size} values")
    filled[: values.size] = values
    filled[values.size :] = values[-1] if values.size else 0
    return filled.reshape(shape)


def _single_values(tensor: Message, field: int, dtype: np.dtype[np.generic]) -> Array:
    if dtype.name in ("float32", "float64"):
        return tensor.reals(field, dtype)
    integers = tensor.integers(field)
    if dtype.name == "float16":  # As the integers their bits make.
        return integers.astype(np.uint16).view(np.float16)
    return integers.astype(dtype)
