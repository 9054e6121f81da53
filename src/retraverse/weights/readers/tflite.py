"""TensorFlow Lite files: constants as float32, and the list of operators that uses them.

Quantised constants come dequantised, ``(q - zero) * scale`` per tensor or per channel, and the
bit-packed kernels of Larq's binary convolutions as -1 and 1. The weights of several convolutions
are channels-last: (out, height, width, in); of depthwise ones (1, height, width, channels).

Sources: the TensorFlow Lite schema; for the binary operators, Bannink et al., "Larq Compute
Engine", MLSys 2021, section 3 (32 channels a word, lowest bit first, a set bit is -1).
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.flatbuffers import FlexValue, Table, read_flex_map, root_table
from retraverse.weights.readers.guard import Budget, reading, whole_content
from retraverse.weights.weight_file import WeightFile

__all__ = ["TfliteModel", "TfliteOperator", "parse_tflite", "read", "read_tflite", "recognise"]


@dataclass(frozen=True)
class TfliteOperator:
    """One step of the network."""

    kind: str
    """``conv_2d``, ``max_pool_2d``, …; a custom operator's own name (``LceBconv2d``); a number
    for built-in ones that no network here uses."""
    inputs: tuple[str, ...]
    """Names of tensors, constant or computed; ``""`` = left out."""
    outputs: tuple[str, ...]
    options: Mapping[str, FlexValue]
    """Under the schema's names; ``padding`` is ``same`` or ``valid``, activations are names."""


@dataclass(frozen=True)
class TfliteModel:
    """The first subgraph of a ``.tflite`` file."""

    tensors: Mapping[str, Array]
    """Constants."""
    shapes: Mapping[str, tuple[int, ...]]
    """Of every tensor, as the file gives it: of a bit-packed one, in words of 32 channels."""
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    operators: tuple[TfliteOperator, ...]
    """In the order they run."""


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts like a ``.tflite`` file."""
    return head[4:8] == b"TFL3"


def read(path: Path) -> WeightFile:
    """Read the constants; the graph goes to the metadata as JSON."""
    model = read_tflite(path)
    graph = {
        "inputs": model.inputs,
        "outputs": model.outputs,
        "shapes": dict(model.shapes),
        "operators": [asdict(operator) for operator in model.operators],
    }
    return WeightFile(model.tensors, {"graph": json.dumps(graph)}, "tflite")


def read_tflite(path: Path) -> TfliteModel:
    """Read constants and operators of a ``.tflite`` file.

    Raises
    ------
    InputError
        If the file is no such file or damaged.
    """
    with reading(path, "a TensorFlow Lite file"):
        return parse_tflite(whole_content(path))


def parse_tflite(content: memoryview) -> TfliteModel:
    """Return what `read_tflite` returns from a file's bytes."""
    root = root_table(content)
    subgraphs = root.tables(2)
    if not subgraphs:
        raise ValueError("it has no subgraph")
    tensors, kinds = subgraphs[0].tables(0), [_kind(code) for code in root.tables(1)]
    names = _unique_names([tensor.text(3) for tensor in tensors])
    operators = tuple(_operator(table, kinds, names) for table in subgraphs[0].tables(3))
    channels = {
        operator.inputs[1]: operator.options["channels_in"]
        for operator in operators
        if operator.kind == "LceBconv2d" and len(operator.inputs) > 1
    }
    shapes = {name: _shape(table) for name, table in zip(names, tensors, strict=True)}
    constants = _constants(dict(zip(names, tensors, strict=True)), root.tables(4), channels)
    inputs, outputs = (_named(subgraphs[0].vector(i, np.int32), names) for i in (1, 2))
    return TfliteModel(constants, shapes, inputs, outputs, operators)


def _shape(tensor: Table) -> tuple[int, ...]:
    return tuple(tensor.vector(0, np.int32).tolist())


def _unique_names(names: list[str]) -> list[str]:
    """Return names with ``#<index>`` added where one comes twice or is empty."""
    seen: set[str] = set()
    unique = []
    for index, name in enumerate(names):
        unique.append(f"{name}#{index}" if name in seen or not name else name)
        seen.add(unique[-1])
    if len(set(unique)) != len(unique):
        raise ValueError("names of its tensors come twice")
    return unique


def _named(indices: Array, names: list[str]) -> tuple[str, ...]:
    if indices.size and (indices.min() < -1 or indices.max() >= len(names)):
        raise ValueError(f"it uses tensor {indices.max()} of {len(names)}")
    return tuple("" if i == -1 else names[i] for i in indices)


def _kind(code: Table) -> str:
    # The newer field holds codes above 127; older files have only the older one.
    number = max(code.integer(0, "b"), code.integer(3, "i"))
    return code.text(1) if number == _CUSTOM else _kinds.get(number, str(number))


def _operator(table: Table, kinds: list[str], names: list[str]) -> TfliteOperator:
    kind = kinds[table.integer(0, "I")]
    inputs, outputs = (_named(table.vector(i, np.int32), names) for i in (1, 2))
    return TfliteOperator(kind, inputs, outputs, _options(table, kind))


def _options(table: Table, kind: str) -> dict[str, FlexValue]:
    if kind.startswith("Lce"):
        custom = bytes(table.vector(5, np.uint8))
        return _worded(read_flex_map(custom) if custom else {})
    options, fields = table.table(4), _option_fields.get(kind, ())
    if options is None:
        return {}
    return _worded({name: options.integer(i, code, default) for i, name, code, default in fields})


def _worded(options: Mapping[str, FlexValue]) -> dict[str, FlexValue]:
    worded = dict(options)
    for name, words in (("padding", _paddings), ("fused_activation_function", _activations)):
        number = worded.get(name)
        if isinstance(number, int):
            worded[name] = words[number]
    return worded


def _constants(
    tensors: Mapping[str, Table], buffers: list[Table], channels: Mapping[str, FlexValue]
) -> dict[str, Array]:
    constants = {}
    budget = Budget(len(buffers[0].content) if buffers else 0, growth=40)
    for name, tensor in tensors.items():
        content = buffers[tensor.integer(2, "I")].vector(0, np.uint8)
        if not content.size:
            continue
        packed = channels.get(name)
        budget.spend(content.size * (32 if packed else 8))
        values = _stored(tensor, content)
        constants[name] = _unpacked(values, packed) if packed else _dequantised(tensor, values)
    return constants


def _stored(tensor: Table, content: Array) -> Array:
    number, shape = tensor.integer(1, "b"), _shape(tensor)
    if number not in _dtypes:
        raise ValueError(f"a constant has the type {number}, expected numbers")
    # A scalar has an empty shape; a negative length would let NumPy guess.
    if min(shape, default=0) < 0:
        raise ValueError(f"a constant has the shape {list(shape)}")
    return np.frombuffer(content.tobytes(), _dtypes[number]).reshape(shape)


def _dequantised(tensor: Table, values: Array) -> Array:
    quantisation = tensor.table(4)
    scale = quantisation.vector(2, np.float32) if quantisation else np.empty(0, np.float32)
    if quantisation is None or not scale.size or values.dtype.kind not in "iu":
        return values.astype(values.dtype.newbyteorder("="))
    zero = quantisation.vector(3, np.int64)
    axis, per_channel = quantisation.integer(6, "i"), [1] * values.ndim
    if scale.size > 1:
        per_channel[axis] = scale.size
    zero = zero if zero.size else np.zeros(scale.size, np.int64)
    if scale.size > 1 and not (scale.size == zero.size == values.shape[axis]):
        raise ValueError(f"{scale.size} scales for {values.shape[axis]} channels")
    centred = values.astype(np.int64) - zero.reshape(per_channel)
    real: Array = (centred * scale.astype(np.float64).reshape(per_channel)).astype(np.float32)
    return real


def _unpacked(words: Array, channels: FlexValue) -> Array:
    fits = isinstance(channels, int) and words.ndim == 4 and words.dtype == np.int32
    if not fits or not 0 < int(channels or 0) <= 32 * words.shape[3]:
        raise ValueError(f"a binary kernel of shape {words.shape} claims {channels} channels")
    as_bytes = words.reshape(-1, 1).view(np.uint8).reshape(*words.shape[:3], -1)
    bits = np.unpackbits(as_bytes, axis=-1, bitorder="little")[..., : int(channels or 0)]
    return np.float32(1) - np.float32(2) * bits


_CUSTOM = 32
_kinds = {
    0: "add",
    1: "average_pool_2d",
    2: "concatenation",
    3: "conv_2d",
    4: "depthwise_conv_2d",
    6: "dequantize",
    9: "fully_connected",
    11: "l2_normalization",
    14: "logistic",
    17: "max_pool_2d",
    18: "mul",
    19: "relu",
    21: "relu6",
    22: "reshape",
    25: "softmax",
    34: "pad",
    40: "mean",
    41: "sub",
    43: "squeeze",
    114: "quantize",
}
_paddings = ("same", "valid")
_activations = ("none", "relu", "relu_n1_to_1", "relu6", "tanh", "sign_bit")
_dtypes: Mapping[int, np.dtype[Any]] = {
    0: np.dtype("<f4"),
    1: np.dtype("<f2"),
    2: np.dtype("<i4"),
    3: np.dtype("u1"),
    4: np.dtype("<i8"),
    6: np.dtype("?"),
    7: np.dtype("<i2"),
    9: np.dtype("i1"),
    10: np.dtype("<f8"),
}
_Field = tuple[int, str, str, int]
_window: tuple[_Field, ...] = (
    (0, "padding", "b", 0),
    (1, "stride_width", "i", 0),
    (2, "stride_height", "i", 0),
)
_activation = "fused_activation_function"
_pool = (
    *_window,
    (3, "filter_width", "i", 0),
    (4, "filter_height", "i", 0),
    (5, _activation, "b", 0),
)
_option_fields: Mapping[str, tuple[_Field, ...]] = {
    "conv_2d": (
        *_window,
        (3, _activation, "b", 0),
        (4, "dilation_width_factor", "i", 1),
        (5, "dilation_height_factor", "i", 1),
    ),
    "depthwise_conv_2d": (
        *_window,
        (3, "depth_multiplier", "i", 0),
        (4, _activation, "b", 0),
        (5, "dilation_width_factor", "i", 1),
        (6, "dilation_height_factor", "i", 1),
    ),
    "average_pool_2d": _pool,
    "max_pool_2d": _pool,
    "fully_connected": ((0, _activation, "b", 0),),
    "concatenation": ((0, "axis", "i", 0), (1, _activation, "b", 0)),
    "add": ((0, _activation, "b", 0),),
    "mul": ((0, _activation, "b", 0),),
    "mean": ((0, "keep_dims", "b", 0),),
}
