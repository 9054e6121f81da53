"""ONNX files: the constants (initializers) of their graph, under the names they have in it.

To run the network itself, give the file to onnxruntime; this is for loading its weights into
another one.

Source: the ONNX project's ``onnx.proto`` (ModelProto, GraphProto, TensorProto).
"""

import math
from pathlib import Path

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import reading, whole_content
from retraverse.weights.readers.protobuf import Message
from retraverse.weights.weight_file import WeightFile

__all__ = ["parse_onnx", "read", "recognise"]

_second_fields = (b"\x12", b"\x1a", b"\x3a")
"""Tags of the producer's name, its version, and the graph."""
_tensor_types = {
    1: ("float32", 4),
    2: ("uint8", 5),
    3: ("int8", 5),
    5: ("int16", 5),
    6: ("int32", 5),
    7: ("int64", 7),
    9: ("bool", 5),
    10: ("float16", 5),
    11: ("float64", 10),
}
"""DataType -> NumPy's name, and the field of TensorProto that holds single values."""


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts with a version and then a producer's name or a graph."""
    return head[:1] == b"\x08" and b"\x03" <= head[1:2] < b"\x40" and head[2:3] in _second_fields


def read(path: Path) -> WeightFile:
    """Read the initializers.

    Raises
    ------
    InputError
        If the file is damaged, or keeps its values in other files.
    """
    with reading(path, "an ONNX file"):
        return parse_onnx(whole_content(path))


def parse_onnx(content: memoryview) -> WeightFile:
    """Return what `read` returns from a file's bytes.

    Raises
    ------
    ValueError
        If they are no ONNX model.
    """
    model = Message(content)
    tensors: dict[str, Array] = {}
    for tensor in model.message(7).messages(5):
        name = tensor.text(8)
        if name in tensors:
            raise ValueError(f"the name {name[:80]!r} comes twice")
        tensors[name] = _tensor(tensor)
    if not tensors:
        raise ValueError("its graph has no weights")
    return WeightFile(tensors, {"producer": model.text(2)}, "onnx")


def _tensor(tensor: Message) -> Array:
    shape, number = tuple(tensor.integers(1).tolist()), tensor.integer(2)
    if 13 in tensor:
        raise ValueError("its weights are in other files: save it as one file")
    if number not in _tensor_types:
        raise ValueError(f"a tensor has the data type {number}, expected plain numbers")
    name, field = _tensor_types[number]
    dtype = np.dtype(name)
    if 9 in tensor:
        values = np.frombuffer(tensor.content(9), dtype.newbyteorder("<")).astype(dtype)
    elif dtype.name in ("float32", "float64"):
        values = tensor.reals(field, dtype)
    elif dtype.name == "float16":
        values = tensor.integers(field).astype(np.uint16).view(np.float16)
    else:
        values = tensor.integers(field).astype(dtype)
    if min(shape, default=0) < 0 or math.prod(shape) != values.size:
        raise ValueError(f"a tensor of shape {shape} has {values.size} values")
    return values.reshape(shape)
