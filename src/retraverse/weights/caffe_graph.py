"""Caffe's network descriptions: ``.prototxt`` files, in both layer formats.

The weights are in the ``.caffemodel`` beside it (`retraverse.weights.readers`); layers and blobs
find each other by the layers' names.

Conventions: shapes are (images, channels, height, width). A layer that writes the blob it reads
works in place: from then on the blob's name means what that layer wrote, so ``conv5`` in a net
with an in-place ReLU is the value *after* the ReLU.

Sources: BVLC Caffe, ``caffe.proto``; Protocol Buffers documentation, "Text Format Language".
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from retraverse.errors import InputError
from retraverse.weights.readers.guard import read_head, reading

__all__ = ["CaffeGraph", "CaffeLayer", "Scalar", "parse_prototxt", "read_prototxt"]

Scalar = int | float | bool | str


@dataclass(frozen=True)
class CaffeLayer:
    """One layer of a Caffe net."""

    name: str
    kind: str
    """As in the newer format: ``Convolution``, ``ReLU``, ``Pooling``, …"""
    bottoms: tuple[str, ...]
    """Names of the blobs it reads."""
    tops: tuple[str, ...]
    """Names of the blobs it writes."""
    parameters: Mapping[str, tuple[Scalar, ...]]
    """Settings under their path, ``"convolution_param.kernel_size"``; always tuples, because
    any setting may be repeated."""

    def values(self, path: str) -> tuple[Scalar, ...]:
        """Return every value of a setting; left out = empty."""
        return self.parameters.get(path, ())

    def integer(self, path: str, default: int) -> int:
        """Return a setting that is a whole number.

        Raises
        ------
        InputError
            If it is something else.
        """
        value = self._last(path, default)
        if type(value) is not int:
            raise InputError(f"layer {self.name!r}: {path} is {value!r}, expected a whole number")
        return value

    def real(self, path: str, default: float) -> float:
        """Return a setting that is a number.

        Raises
        ------
        InputError
            If it is something else.
        """
        value = self._last(path, default)
        if isinstance(value, bool | str):
            raise InputError(f"layer {self.name!r}: {path} is {value!r}, expected a number")
        return float(value)

    def word(self, path: str, default: str) -> str:
        """Return a setting that is a name, as text."""
        return str(self._last(path, default))

    def flag(self, path: str, default: bool) -> bool:
        """Return a setting that is true or false."""
        return bool(self._last(path, default))

    def _last(self, path: str, default: Scalar) -> Scalar:
        values = self.values(path)
        return values[-1] if values else default


@dataclass(frozen=True)
class CaffeGraph:
    """A Caffe net as it is when used (phase TEST): its inputs, and its layers in running order."""

    name: str
    inputs: Mapping[str, tuple[int, ...]]
    """Blob -> shape."""
    layers: tuple[CaffeLayer, ...]
    """Without those that only feed or train the net."""


def read_prototxt(path: Path | str) -> CaffeGraph:
    """Read a ``.prototxt`` file.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If it is no prototxt, with the line that is wrong.
    """
    path = Path(path)
    read_head(path)
    with reading(path, "a prototxt"):
        return parse_prototxt(path.read_bytes().decode("utf-8"))


def parse_prototxt(text: str) -> CaffeGraph:
    """Return the graph in a prototxt's text.

    Raises
    ------
    ValueError
        If it is none.
    """
    net = _flattened(_block(_tokens(text), closing=""))
    layers = [_layer(layer) for layer in net.messages if layer.name in ("layer", "layers")]
    used = [layer for layer in layers if layer is not None]
    if not used:
        raise ValueError("it has no layers")
    inputs = _top_inputs(net)
    for layer in used:
        if layer.kind == "Input":
            inputs |= _input_layer(layer)
    run = tuple(layer for layer in used if layer.kind not in _feeding)
    return CaffeGraph(str(net.last("name", "")), inputs, run)


@dataclass(frozen=True)
class _Token:
    text: str
    line: int


@dataclass(frozen=True)
class _Entry:
    name: str
    value: "Scalar | list[_Entry]"


@dataclass(frozen=True)
class _Flat:
    """A block with its settings under their paths, and its inner blocks."""

    name: str
    settings: Mapping[str, tuple[Scalar, ...]]
    messages: "list[_Flat]"

    def last(self, path: str, default: Scalar) -> Scalar:
        return self.settings.get(path, (default,))[-1]


_pattern = re.compile(
    r"""(?P<skip>\s+|\#[^\n]*|[,;])|(?P<string>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')"""
    r"""|(?P<word>[A-Za-z_][\w.]*|[-+]?[0-9.][\w.+-]*)|(?P<sign>[{}<>:\[\]])"""
)
_DEEPEST = 16


def _tokens(text: str) -> Iterator[_Token]:
    place, line = 0, 1
    while place < len(text):
        match = _pattern.match(text, place)
        if match is None:
            raise ValueError(f"line {line} has {text[place]!r} where it cannot be")
        if match.lastgroup != "skip":
            yield _Token(match.group(), line)
        line += match.group().count("\n")
        place = match.end()


def _block(tokens: Iterator[_Token], closing: str, depth: int = 0) -> list[_Entry]:
    """Return the entries up to the closing sign (empty: to the end)."""
    if depth > _DEEPEST:
        raise ValueError(f"blocks lie more than {_DEEPEST} deep")
    entries: list[_Entry] = []
    for token in tokens:
        if token.text == closing:
            return entries
        if not re.match(r"[A-Za-z_]", token.text):
            raise ValueError(f"line {token.line} has {token.text!r}, expected a name")
        entries += _values(token, tokens, depth)
    if closing:
        raise ValueError(f"it ends before a {closing!r}")
    return entries


def _values(name: _Token, tokens: Iterator[_Token], depth: int) -> list[_Entry]:
    sign = _next(tokens, name)
    if sign.text == ":":
        sign = _next(tokens, name)
    if sign.text in _closings:
        return [_Entry(name.text, _block(tokens, _closings[sign.text], depth + 1))]
    if sign.text != "[":
        return [_Entry(name.text, _scalar(sign))]
    listed = iter(lambda: _next(tokens, name).text, "]")
    return [_Entry(name.text, _scalar(_Token(text, name.line))) for text in listed]


def _next(tokens: Iterator[_Token], name: _Token) -> _Token:
    token = next(tokens, None)
    if token is None:
        raise ValueError(f"it ends after {name.text!r} in line {name.line}")
    return token


_closings = {"{": "}", "<": ">"}


def _scalar(token: _Token) -> Scalar:
    text = token.text
    if text[0] in "\"'":
        return re.sub(r"\\(.)", r"\1", text[1:-1])
    if text in ("true", "false"):
        return text == "true"
    if re.fullmatch(r"[-+]?\d{1,18}", text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        pass
    if not re.match(r"[A-Za-z_]", text):
        raise ValueError(f"line {token.line} has the value {text!r}")
    return text


def _flattened(entries: list[_Entry], name: str = "") -> _Flat:
    settings: dict[str, tuple[Scalar, ...]] = {}
    messages = []
    for entry in entries:
        if not isinstance(entry.value, list):
            settings[entry.name] = (*settings.get(entry.name, ()), entry.value)
            continue
        inner = _flattened(entry.value, entry.name)
        messages.append(inner)
        for path, values in inner.settings.items():
            full = f"{entry.name}.{path}"
            settings[full] = settings.get(full, ()) + values
    return _Flat(name, settings, messages)


def _layer(block: _Flat) -> CaffeLayer | None:
    """Return a layer, None if it is only there for training."""
    phases = [m.settings.get("phase") for m in block.messages if m.name == "include"]
    excluded = [m.settings.get("phase") for m in block.messages if m.name == "exclude"]
    if (phases and ("TEST",) not in phases) or ("TEST",) in excluded:
        return None
    kind = str(block.last("type", ""))
    return CaffeLayer(
        name=str(block.last("name", "")),
        kind=_old_kinds.get(kind, kind),
        bottoms=tuple(str(bottom) for bottom in block.settings.get("bottom", ())),
        tops=tuple(str(top) for top in block.settings.get("top", ())),
        parameters={
            path: values
            for path, values in block.settings.items()
            if path not in ("name", "type", "bottom", "top")
        },
    )


def _top_inputs(net: _Flat) -> dict[str, tuple[int, ...]]:
    names = [str(name) for name in net.settings.get("input", ())]
    dims = _dims(net.settings.get("input_dim", ()))
    shapes = [dims[i : i + 4] for i in range(0, len(dims), 4)]
    shapes = shapes or [
        _dims(block.settings.get("dim", ()))
        for block in net.messages
        if block.name == "input_shape"
    ]
    if len(shapes) != len(names):
        raise ValueError(f"it has {len(names)} inputs but {len(shapes)} input shapes")
    return dict(zip(names, shapes, strict=True))


def _input_layer(layer: CaffeLayer) -> dict[str, tuple[int, ...]]:
    shape = _dims(layer.values("input_param.shape.dim"))
    return dict.fromkeys(layer.tops, shape)


def _dims(values: tuple[Scalar, ...]) -> tuple[int, ...]:
    dims = tuple(value for value in values if type(value) is int and 0 < value < 1 << 20)
    if len(dims) != len(values):
        raise ValueError(f"an input has the shape {list(values)}")
    return dims


_feeding = frozenset(
    {"Input", "Data", "ImageData", "HDF5Data", "Accuracy", "SoftmaxWithLoss", "Silence", "Python"}
)
_old_kinds = {
    "CONCAT": "Concat",
    "CONVOLUTION": "Convolution",
    "DATA": "Data",
    "DROPOUT": "Dropout",
    "ELTWISE": "Eltwise",
    "FLATTEN": "Flatten",
    "IMAGE_DATA": "ImageData",
    "INNER_PRODUCT": "InnerProduct",
    "POOLING": "Pooling",
    "POWER": "Power",
    "RELU": "ReLU",
    "SIGMOID": "Sigmoid",
    "SOFTMAX": "Softmax",
    "SOFTMAX_LOSS": "SoftmaxWithLoss",
    "SPLIT": "Split",
    "TANH": "TanH",
    "ACCURACY": "Accuracy",
}
