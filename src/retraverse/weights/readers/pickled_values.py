"""The names a pickle may mention, and the plain values made in their place.

Tensors of torch and arrays of NumPy are rebuilt from their bytes here; neither torch nor NumPy's
own unpickling is called. Objects of a few known families (whole torch modules, Lightning's
settings, scikit-learn models) are kept as `Inert`: their tensors can be found in them.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import Budget
from retraverse.weights.readers.pickle_machine import Global, Inert, Maker

__all__ = [
    "MAKERS",
    "PendingArray",
    "Storage",
    "StoredTensor",
    "is_inert",
    "storage_dtype",
    "widened",
]


@dataclass(frozen=True, eq=False)
class Storage:
    """A row of numbers that tensors are views of; its bytes lie elsewhere in the file."""

    kind: str
    """``float32``, …; also ``bfloat16``, which NumPy has not."""
    key: str
    n_elements: int
    start: int = 0
    """First element in the row called `key`: storages can be views too, in old files."""


@dataclass(frozen=True, eq=False)
class StoredTensor:
    """A tensor whose storage has not been read."""

    storage: Storage
    start: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    """In elements."""

    def values(self, row: Array, budget: Budget) -> Array:
        """Return the tensor as an array of its own, given its storage's numbers.

        Raises
        ------
        ValueError
            If it reaches outside of its storage.
        """
        if self.start < 0 or min((*self.shape, *self.strides), default=0) < 0:
            raise ValueError("a tensor has a negative size")
        empty = 0 in self.shape
        steps = zip(self.shape, self.strides, strict=True)
        last = self.start + sum((length - 1) * stride for length, stride in steps)
        if not empty and last >= len(row):
            raise ValueError(f"a tensor reaches to number {last} of {len(row)}")
        budget.spend(int(np.prod(self.shape, dtype=object)) * max(row.itemsize, 4))
        if empty:
            return np.empty(self.shape, row.dtype)
        strides = [stride * row.itemsize for stride in self.strides]
        view = np.lib.stride_tricks.as_strided(row[self.start :], self.shape, strides)
        return np.array(view, order="C")


class PendingArray:
    """A NumPy array between its creation and its state."""

    def __init__(self) -> None:
        self.array: Array | list[Any] = np.empty(0)

    def take_state(self, state: Any, budget: Budget) -> None:
        """Take shape, type and content."""
        _, shape, dtype, is_fortran, content = state
        if isinstance(content, list):
            self.array = content
            return
        self.array = _array(content, dtype, shape, "F" if is_fortran else "C", budget)


class _PendingType:
    """A NumPy data type; its byte order comes as state."""

    def __init__(self, code: Any) -> None:
        if not isinstance(code, str) or not re.fullmatch(r"[|<>=]?([biufcOSUV]\d{1,6}|b|\?)", code):
            raise ValueError(f"an array has the type {code!r:.80}")
        self._code = code
        self._order: Literal["<", ">", "="] = "="

    def take_state(self, state: Any, budget: Budget) -> None:
        self._order = state[1] if state[1] in ("<", ">", "=") else "="

    def dtype(self) -> np.dtype[Any]:
        dtype = np.dtype(self._code)
        if dtype.kind not in "biufc":
            raise ValueError(f"an array has the type {dtype}, expected numbers")
        return dtype.newbyteorder(self._order) if self._order != "=" else dtype


def _array(content: Any, dtype: Any, shape: Any, order: Any, budget: Budget) -> Array:
    # Pickles of Python 2 hold bytes as text.
    data = content.encode("latin-1") if isinstance(content, str) else content
    if not isinstance(data, bytes | bytearray) or not isinstance(dtype, _PendingType):
        raise ValueError("an array has no content")
    if not _are_lengths(shape):
        raise ValueError("an array has no shape")
    budget.spend(len(data))
    values = np.frombuffer(data, dtype.dtype())
    if order not in ("C", "F") or int(np.prod(shape, dtype=object)) != values.size:
        raise ValueError(f"an array of shape {shape} has {values.size} values")
    native = values.dtype.newbyteorder("=")
    return np.ascontiguousarray(values.reshape(shape, order=order), native)


def _are_lengths(numbers: Any) -> bool:
    return isinstance(numbers, tuple | list) and all(
        type(number) is int and 0 <= number < 1 << 48 for number in numbers
    )


def _scalar(arguments: tuple[Any, ...], budget: Budget) -> Any:
    return _array(arguments[1], arguments[0], (1,), "C", budget)[0].item()


def _from_buffer(arguments: tuple[Any, ...], budget: Budget) -> Array:
    content, dtype, shape, order = arguments
    return _array(content, dtype, shape, order, budget)


def _tensor(arguments: tuple[Any, ...], budget: Budget) -> StoredTensor:
    storage, start, shape, strides = arguments[:4]
    if not isinstance(storage, Storage) or not _are_lengths([start]):
        raise ValueError("a tensor has no storage")
    if not _are_lengths(shape) or not _are_lengths(strides) or len(shape) != len(strides):
        raise ValueError("a tensor has no shape")
    return StoredTensor(storage, start, tuple(shape), tuple(strides))


def _first(arguments: tuple[Any, ...], budget: Budget) -> Any:
    return arguments[0]


def _tensor_of_type(arguments: tuple[Any, ...], budget: Budget) -> Any:
    # A subclass of torch's tensor: how it is made, its class, the arguments, its state.
    maker = MAKERS.get(arguments[0])
    if maker is None:
        raise ValueError("a tensor is made in an unknown way")
    return maker(arguments[2], budget)


def _table(arguments: tuple[Any, ...], budget: Budget) -> dict[Any, Any]:
    pairs = arguments[0] if arguments else []
    if isinstance(pairs, Global) or pairs is None:
        return {}  # A defaultdict's factory.
    if isinstance(pairs, dict):
        budget.spend(8 * len(pairs))
        return dict(pairs)
    table = {}
    for key, value in pairs:
        if not isinstance(key, str | int):
            raise ValueError("a table has a key that is no text")
        table[key] = value
        budget.spend(8)
    return table


def _copy_of(kind: Callable[[Any], Any]) -> Maker:
    def make(arguments: tuple[Any, ...], budget: Budget) -> Any:
        values = arguments[0] if arguments else ()
        if not isinstance(values, list | tuple):
            raise ValueError("a container is made of what is no list")
        budget.spend(8 * len(values))
        return kind(values)

    return make


def _encoded(arguments: tuple[Any, ...], budget: Budget) -> bytes:
    text, encoding = arguments
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise ValueError("bytes are made of what is no text")
    budget.spend(len(text))
    return text.encode("latin-1")


def _bytes(arguments: tuple[Any, ...], budget: Budget) -> bytes:
    # How protocols before 3 write that there are none; others go through _codecs.encode.
    if arguments:
        raise ValueError("bytes are made of numbers")
    return b""


def _reconstructed(arguments: tuple[Any, ...], budget: Budget) -> Any:
    kind = arguments[0]
    if not isinstance(kind, Global):
        raise ValueError("an object has no class")
    if str(kind) in ("collections.OrderedDict", "builtins.dict"):
        return {}
    return Inert(kind)


def _size(arguments: tuple[Any, ...], budget: Budget) -> Any:
    return tuple(arguments[0]) if arguments and isinstance(arguments[0], tuple | list) else ()


_kinds = {
    "DoubleStorage": "float64",
    "FloatStorage": "float32",
    "HalfStorage": "float16",
    "BFloat16Storage": "bfloat16",
    "LongStorage": "int64",
    "IntStorage": "int32",
    "ShortStorage": "int16",
    "CharStorage": "int8",
    "ByteStorage": "uint8",
    "BoolStorage": "bool",
    "UntypedStorage": "uint8",
}


def storage_dtype(named: Any) -> str:
    """Return the kind of numbers of a storage's class (`Storage.kind`).

    Raises
    ------
    ValueError
        If it is no class of storages of plain numbers.
    """
    if not isinstance(named, Global) or named.name not in _kinds:
        raise ValueError(f"a tensor's storage is a {str(named)[:80]}, expected plain numbers")
    return _kinds[named.name]


def widened(content: bytes, kind: str, order: Literal["<", ">"]) -> Array:
    """Return a storage's bytes as numbers; bfloat16 as float32. `order` is ``<`` or ``>``."""
    if kind != "bfloat16":
        values = np.frombuffer(content, np.dtype(kind).newbyteorder(order))
        return values.astype(kind, copy=False)
    halves = np.frombuffer(content, np.dtype("u2").newbyteorder(order))
    return (halves.astype(np.uint32) << 16).view(np.float32)


def _makers() -> Mapping[Global, Maker]:
    makers: dict[str, Maker] = {
        "collections.OrderedDict": _table,
        "collections.defaultdict": _table,
        "collections.Counter": _table,
        "_codecs.encode": _encoded,
        "torch._utils._rebuild_tensor": _tensor,
        "torch._utils._rebuild_tensor_v2": _tensor,
        "torch._utils._rebuild_parameter": _first,
        "torch._utils._rebuild_parameter_with_state": _first,
        "torch._tensor._rebuild_from_type_v2": _tensor_of_type,
        "torch.Size": _size,
        "numpy.dtype": lambda arguments, _: _PendingType(arguments[0]),
    }
    for builtins in ("builtins", "__builtin__"):
        makers |= {f"{builtins}.{name}": _copy_of(list) for name in ("list", "set", "bytearray")}
        makers |= {f"{builtins}.{name}": _copy_of(tuple) for name in ("tuple", "frozenset")}
        makers[f"{builtins}.dict"] = _table
        makers[f"{builtins}.bytes"] = _bytes
    for registry in ("copyreg", "copy_reg"):
        makers[f"{registry}._reconstructor"] = _reconstructed
    for core in ("numpy.core", "numpy._core"):
        makers[f"{core}.multiarray._reconstruct"] = lambda arguments, _: PendingArray()
        makers[f"{core}.multiarray.scalar"] = _scalar
        makers[f"{core}.numeric._frombuffer"] = _from_buffer
    return {Global(*name.rsplit(".", 1)): maker for name, maker in makers.items()}


MAKERS = _makers()
"""What may be called, and what is done in its place."""

_inert_names = frozenset(
    {
        "argparse.Namespace",
        "builtins.bool",
        "builtins.complex",
        "builtins.float",
        "builtins.int",
        "builtins.object",
        "builtins.slice",
        "builtins.str",
        "__builtin__.object",
        "numpy.ndarray",
        "pathlib.Path",
        "pathlib.PosixPath",
        "pathlib.PurePosixPath",
        "pathlib.WindowsPath",
        "torch.Tensor",
        "torch._C._nn.gelu",
        "torch.device",
        "torch.nn.parameter.Parameter",
        "torch.nn.parameter.Buffer",
        "torch.serialization._get_layout",
        "types.SimpleNamespace",
        *(f"torch.{kind}" for kind in set(_kinds) | set(_kinds.values())),
        "torch.storage.TypedStorage",
        "torch.storage.UntypedStorage",
        "torch.storage._TypedStorage",
        "torch.storage._UntypedStorage",
    }
)
_inert_families = (
    "__torch__.",
    "lightning.",
    "lightning_fabric.",
    "omegaconf.",
    "pytorch_lightning.",
    "sklearn.",
    "torch.nn.modules.",
    "torch.optim.",
    "torchvision.models.",
    "torchvision.ops.",
    "yacs.config.",
)


def is_inert(named: Global) -> bool:
    """Return whether objects of a class may be kept without their code."""
    dotted = str(named)
    return dotted in _inert_names or dotted.startswith(_inert_families)
