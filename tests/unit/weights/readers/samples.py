"""Small weight files of every format, written by what is not under test.

Protocol Buffers are put together here byte by byte (and read back by OpenCV or the onnx package
in the tests); everything else is written by the format's own library.
"""

import io
import pickle
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Arrays = Mapping[str, np.ndarray[Any, Any]]


def random_arrays(seed: int = 0) -> dict[str, np.ndarray[Any, Any]]:
    random = np.random.default_rng(seed)
    shapes = {"conv1.0": (4, 3, 3, 3), "conv1.1": (4,), "fc.0": (5, 16), "fc.1": (5,)}
    return {k: random.standard_normal(shape).astype(np.float32) for k, shape in shapes.items()}


# Protocol Buffers


def varint(number: int) -> bytes:
    number &= (1 << 64) - 1
    out = b""
    while number > 127:
        out, number = out + bytes([number & 127 | 128]), number >> 7
    return out + bytes([number])


def number(field: int, value: int) -> bytes:
    return varint(field << 3) + varint(value)


def block(field: int, content: bytes | str) -> bytes:
    content = content.encode() if isinstance(content, str) else content
    return varint(field << 3 | 2) + varint(len(content)) + content


def blob(array: np.ndarray[Any, Any], style: str = "shape") -> bytes:
    """Return a BlobProto: dims as a shape or the old way, values packed or one by one."""
    if style == "legacy":
        dims = (1,) * (4 - array.ndim) + array.shape
        head = b"".join(number(i + 1, dim) for i, dim in enumerate(dims))
    else:
        head = block(7, block(1, b"".join(varint(dim) for dim in array.shape)))
    if array.dtype == np.float64:
        return head + block(8, array.tobytes())
    if style == "unpacked":
        values = array.astype("<f4").ravel()
        return head + b"".join(varint(5 << 3 | 5) + struct.pack("<f", v) for v in values)
    return head + block(5, array.astype("<f4").tobytes())


def caffemodel(arrays: Arrays, style: str = "shape", name: str = "net", v1: bool = False) -> bytes:
    layers: dict[str, bytes] = {}
    for key, array in arrays.items():
        layer = key.rpartition(".")[0]
        layers[layer] = layers.get(layer, b"") + block(6 if v1 else 7, blob(array, style))
    out = block(1, name)
    for layer, blobs in layers.items():
        named = block(4, layer) + number(5, 4) if v1 else block(1, layer) + block(2, "Convolution")
        out += block(2 if v1 else 100, named + blobs)
    return out


def tensor_proto(array: np.ndarray[Any, Any]) -> bytes:
    kinds = {"float32": 1, "int32": 3, "int64": 9}
    dims = b"".join(block(2, number(1, size)) for size in array.shape)
    return number(1, kinds[array.dtype.name]) + block(2, dims) + block(4, array.tobytes())


def attribute(name: str, value: bytes) -> bytes:
    return block(5, block(1, name) + block(2, value))


def node(name: str, kind: str, inputs: Sequence[str] = (), attributes: bytes = b"") -> bytes:
    texts = b"".join(block(3, text) for text in inputs)
    return block(1, block(1, name) + block(2, kind) + texts + attributes)


def frozen_graph(arrays: Arrays) -> bytes:
    out = node("input", "Placeholder", (), attribute("dtype", number(6, 1)))
    for name, array in arrays.items():
        value = attribute("dtype", number(6, 1)) + attribute("value", block(8, tensor_proto(array)))
        out += node(name, "Const", (), value)
    strides = attribute("strides", block(1, block(3, bytes([1, 2, 2, 1]))))
    settings = strides + attribute("padding", block(2, "SAME")) + attribute("T", number(6, 1))
    settings += attribute("data_format", block(2, "NHWC"))
    return out + node("conv", "Conv2D", ("input", next(iter(arrays))), settings)


# Others


def keras(arrays: Arrays) -> bytes:
    h5py = pytest.importorskip("h5py")
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs["keras_version"] = b"2.2.4"
        group = file.create_group("model_weights")
        for name, array in arrays.items():
            layer, _, kind = name.rpartition(".")
            packing = {"chunks": array.shape, "compression": "gzip", "shuffle": True}
            group.create_dataset(f"{layer}/{layer}/{kind}:0", data=array, **packing)
    return stream.getvalue()


def matlab(arrays: Arrays, compressed: bool = True) -> bytes:
    io_module = pytest.importorskip("scipy.io")
    cell = np.empty((1, len(arrays)), object)
    for i, array in enumerate(arrays.values()):
        cell[0, i] = array
    several = np.zeros((1, 2), [("w", object), ("name", object)])
    for i in range(2):
        several[0, i] = (np.arange(6.0).reshape(2, 3) + i, f"layer {i}")
    content = {"net": {"layers": cell, "meta": {"name": "vd16"}}, "s": several}
    stream = io.BytesIO()
    io_module.savemat(stream, content, do_compression=compressed)
    return stream.getvalue()


def matlab_73(arrays: Arrays) -> bytes:
    """Return an HDF5 file laid out as MATLAB does: header, axes turned round, references."""
    h5py = pytest.importorskip("h5py")
    stream = io.BytesIO()
    with h5py.File(stream, "w", userblock_size=512) as file:
        net, refs = file.create_group("net"), file.create_group("#refs#")
        kept = []
        for i, array in enumerate(arrays.values()):
            refs[f"r{i}"] = array.T
            refs[f"r{i}"].attrs["MATLAB_class"] = np.bytes_("single")
            kept.append(refs[f"r{i}"].ref)
        cells = np.array(kept, h5py.ref_dtype).reshape(-1, 1)
        net.create_dataset("layers", data=cells, dtype=h5py.ref_dtype)
        net["layers"].attrs["MATLAB_class"] = np.bytes_("cell")
        net["name"] = np.array([[ord(letter)] for letter in "vd16"], np.uint16)
        net["name"].attrs["MATLAB_class"] = np.bytes_("char")
    content = bytearray(stream.getvalue())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    return bytes(content)


def torch_file(arrays: Arrays, zipped: bool = True) -> bytes:
    torch = pytest.importorskip("torch")
    state = {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}
    stream = io.BytesIO()
    content = {"epoch": 3, "state_dict": state, "half": state["fc.0"].half()}
    torch.save(content, stream, _use_new_zipfile_serialization=zipped)
    return stream.getvalue()


def safetensors(arrays: Arrays) -> bytes:
    from safetensors.numpy import save

    return bytes(save(dict(arrays), {"made": "for a test"}))


def npz(arrays: Arrays) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def npy(arrays: Arrays) -> bytes:
    stream = io.BytesIO()
    np.save(stream, next(iter(arrays.values())))
    return stream.getvalue()


def onnx_model(arrays: Arrays) -> bytes:
    onnx = pytest.importorskip("onnx")
    tensors = [onnx.numpy_helper.from_array(np.array(a), name) for name, a in arrays.items()]
    graph = onnx.helper.make_graph([], "graph", [], [], initializer=tensors)
    return bytes(onnx.helper.make_model(graph, producer_name="test").SerializeToString())


def tflite(binary_kernel: np.ndarray[Any, Any] | None = None, seed: int = 0) -> bytes:
    """Return a convolution with int8 weights per channel and, asked for, a binary one."""
    flatbuffers = pytest.importorskip("flatbuffers")
    builder = flatbuffers.Builder(1024)
    quantised = np.random.default_rng(seed).integers(-128, 128, (4, 3, 3, 2), np.int8)
    buffers = [b"", quantised.tobytes(), np.arange(4, dtype="<f4").tobytes()]
    scales, zeros = np.array([0.5, 0.25, 2, 1], np.float32), np.array([0, 0, 3, 0], np.int64)
    tensors = [
        _tensor(builder, "input", (1, 8, 8, 2), 0, 0),
        _tensor(builder, "kernel", quantised.shape, 9, 1, (scales, zeros, 0)),
        _tensor(builder, "bias", (4,), 0, 2),
        _tensor(builder, "output", (1, 4, 4, 4), 0, 0),
    ]
    conv = _table(builder, {0: ("b", 0), 1: ("i", 2), 2: ("i", 2), 3: ("b", 1)})
    operators = [_operator(builder, 0, (0, 1, 2), (3,), options=conv)]
    if binary_kernel is not None:
        buffers.append(packed(binary_kernel).tobytes())
        shape = packed(binary_kernel).shape
        tensors += [_tensor(builder, "binary", shape, 2, 3)]
        tensors += [_tensor(builder, "last", (1, 4, 4, binary_kernel.shape[0]), 0, 0)]
        flex = flexbuffer({"channels_in": binary_kernel.shape[3], "padding": 0, "stride_width": 1})
        operators.append(_operator(builder, 1, (3, 4, -1), (5,), custom=flex))
    ends = (len(tensors) - 1,)
    codes = [
        _table(builder, {0: ("b", 3), 3: ("i", 3)}),
        _table(builder, {0: ("b", 32), 1: ("u", builder.CreateString("LceBconv2d")), 3: ("i", 32)}),
    ]
    graph = {
        0: ("u", _offsets(builder, tensors)),
        1: ("u", builder.CreateNumpyVector(np.array([0], np.int32))),
        2: ("u", builder.CreateNumpyVector(np.array(ends, np.int32))),
        3: ("u", _offsets(builder, operators)),
    }
    stored = [
        _table(builder, {0: ("u", builder.CreateByteVector(b))} if b else {}) for b in buffers
    ]
    model = {
        0: ("I", 3),
        1: ("u", _offsets(builder, codes)),
        2: ("u", _offsets(builder, [_table(builder, graph)])),
        4: ("u", _offsets(builder, stored)),
    }
    builder.Finish(_table(builder, model), file_identifier=b"TFL3")
    return bytes(builder.Output())


def packed(kernel: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return a kernel of -1 and 1 as words of 32 channels, bit by bit in a plain loop."""
    *outer, channels = kernel.shape
    words = np.zeros((*outer, -(-channels // 32)), np.uint32)
    for index in np.ndindex(*kernel.shape):
        if kernel[index] < 0:
            words[(*index[:-1], index[-1] // 32)] |= np.uint32(1 << index[-1] % 32)
    return words.view(np.int32)


def flexbuffer(values: Mapping[str, int]) -> bytes:
    flexbuffers = pytest.importorskip("flatbuffers.flexbuffers")
    return bytes(flexbuffers.Dumps(dict(values)))


def _table(builder: Any, fields: Mapping[int, tuple[str, Any]]) -> int:
    add = {
        "b": builder.PrependInt8Slot,
        "i": builder.PrependInt32Slot,
        "I": builder.PrependUint32Slot,
        "u": builder.PrependUOffsetTRelativeSlot,
    }
    builder.StartObject(max(fields, default=0) + 1)
    for slot, (kind, value) in fields.items():
        # A default that never occurs, so that every field is written.
        add[kind](slot, value, -99 if kind in "bi" else 0)
    return int(builder.EndObject())


def _offsets(builder: Any, places: Sequence[int]) -> int:
    builder.StartVector(4, len(places), 4)
    for place in reversed(places):
        builder.PrependUOffsetTRelative(place)
    return int(builder.EndVector())


def _tensor(
    builder: Any,
    name: str,
    shape: Sequence[int],
    kind: int,
    buffer: int,
    quantisation: tuple[Any, Any, int] | None = None,
) -> int:
    fields: dict[int, tuple[str, Any]] = {
        0: ("u", builder.CreateNumpyVector(np.array(shape, np.int32))),
        1: ("b", kind),
        2: ("I", buffer),
        3: ("u", builder.CreateString(name)),
    }
    if quantisation is not None:
        scale, zero, axis = quantisation
        parts = {
            2: ("u", builder.CreateNumpyVector(scale)),
            3: ("u", builder.CreateNumpyVector(zero)),
            6: ("i", axis),
        }
        fields[4] = ("u", _table(builder, parts))
    return _table(builder, fields)


def _operator(
    builder: Any,
    code: int,
    inputs: Sequence[int],
    outputs: Sequence[int],
    options: int | None = None,
    custom: bytes = b"",
) -> int:
    fields: dict[int, tuple[str, Any]] = {
        0: ("I", code),
        1: ("u", builder.CreateNumpyVector(np.array(inputs, np.int32))),
        2: ("u", builder.CreateNumpyVector(np.array(outputs, np.int32))),
    }
    if options is not None:
        fields |= {3: ("b", 1), 4: ("u", options)}
    if custom:
        fields[5] = ("u", builder.CreateByteVector(custom))
    return _table(builder, fields)


SAMPLES: dict[str, Callable[[], bytes]] = {
    "caffemodel": lambda: caffemodel(random_arrays()),
    "caffemodel V1": lambda: caffemodel(random_arrays(), "legacy", v1=True),
    "binaryproto": lambda: blob(random_arrays()["conv1.0"], "legacy"),
    "tensorflow": lambda: frozen_graph({"w": np.ones((3, 3, 2, 4), np.float32)}),
    "keras": lambda: keras(random_arrays()),
    "matlab": lambda: matlab(random_arrays(), compressed=False),
    "matlab compressed": lambda: matlab(random_arrays()),
    "matlab 7.3": lambda: matlab_73(random_arrays()),
    "torch": lambda: torch_file(random_arrays()),
    "torch legacy": lambda: torch_file(random_arrays(), zipped=False),
    "pickle": lambda: pickle.dumps(random_arrays(), protocol=2),
    "pickle 0": lambda: pickle.dumps(random_arrays(), protocol=0),
    "tflite": lambda: tflite(np.ones((2, 1, 1, 40), np.float32)),
    "safetensors": lambda: safetensors(random_arrays()),
    "npz": lambda: npz(random_arrays()),
    "npy": lambda: npy(random_arrays()),
    "onnx": lambda: onnx_model(random_arrays()),
}


def written(folder: Path, content: bytes, name: str = "weights.bin") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path
