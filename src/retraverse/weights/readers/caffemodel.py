"""Caffe's weights: ``.caffemodel`` in both layer formats, and ``.binaryproto`` mean images.

Blobs are named ``"<layer>.<i>"``, 0 the weight and 1 the bias. Shapes are the file's own: a file
from before 2014 gives every blob four axes, a bias as (1, 1, 1, N) and a fully connected weight
as (1, 1, outputs, inputs). Convolution weights are (out, in / groups, height, width); the channels
of pictures are in the order blue, green, red.

Source: BVLC Caffe, ``caffe.proto`` (messages NetParameter, LayerParameter, V1LayerParameter,
BlobProto).
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from retraverse.types import Array
from retraverse.weights.readers.guard import reading, whole_content
from retraverse.weights.readers.protobuf import Message
from retraverse.weights.weight_file import WeightFile

__all__ = ["parse_blob", "parse_caffemodel", "read", "recognise"]

# Fields of NetParameter, with those of the layers in each format: name, blobs.
_NET_NAME, _V1_LAYERS, _LAYERS = 1, 2, 100
_layer_fields = {_LAYERS: (1, 7), _V1_LAYERS: (4, 6)}
_V0_LAYER = 1
# Fields of BlobProto.
_LEGACY_DIMS, _DATA, _SHAPE, _DOUBLE_DATA = (1, 2, 3, 4), 5, 7, 8


def recognise(head: bytes, path: Path) -> bool:
    """Return whether a file starts like a caffemodel or a binaryproto."""
    # A net's name, or layers of either format; a blob's dims, values or shape. A net's name looks
    # like a TensorFlow node and a blob's first dim like an ONNX version: those are asked before.
    return head[:2] == b"\xa2\x06" or (
        head[:1] in (b"\x0a", b"\x12", b"\x2a", b"\x3a")
        or (head[:1] == b"\x08" and b"\x10" in head[2:6])
    )


def read(path: Path) -> WeightFile:
    """Read a caffemodel or binaryproto.

    Raises
    ------
    InputError
        If the file is neither or damaged.
    """
    with reading(path, "a caffemodel"):
        return parse_caffemodel(whole_content(path))


def parse_caffemodel(content: memoryview) -> WeightFile:
    """Return what `read` returns from a file's bytes.

    Raises
    ------
    ValueError
        If they are no caffemodel.
    """
    net = Message(content)
    if not net.numbers() & {_LAYERS, _V1_LAYERS} or _is_blob(net):
        return WeightFile({"mean": parse_blob(net)}, {"kind": "binaryproto"}, "caffemodel")
    tensors: dict[str, Array] = {}
    for name, array in _blobs(net):
        if name in tensors:
            raise ValueError(f"layer {name.rpartition('.')[0]!r} has its blobs twice")
        tensors[name] = array
    if not tensors:
        raise ValueError("it has layers but no blobs")
    return WeightFile(tensors, {"name": net.text(_NET_NAME)}, "caffemodel")


def _is_blob(net: Message) -> bool:
    # Field 2 is a blob's channels (an integer) or a net's V1 layers (messages).
    return _LAYERS not in net and (_DATA in net or _DOUBLE_DATA in net) and _has_dims(net)


def _has_dims(blob: Message) -> bool:
    return bool(blob.numbers() & {*_LEGACY_DIMS, _SHAPE})


def _blobs(net: Message) -> Iterator[tuple[str, Array]]:
    for layers, (name_field, blobs_field) in _layer_fields.items():
        for layer in net.messages(layers):
            if layers == _V1_LAYERS and _V0_LAYER in layer:
                raise ValueError("its layers are in Caffe's oldest format (V0), which is not read")
            name = layer.text(name_field)
            for i, blob in enumerate(layer.messages(blobs_field)):
                yield f"{name}.{i}", parse_blob(blob)


def parse_blob(blob: Message) -> Array:
    """Return a BlobProto's values in its shape: float32, or float64 if it holds those.

    Raises
    ------
    ValueError
        If values and shape do not fit, or there are none.
    """
    if _SHAPE in blob:
        shape = blob.message(_SHAPE).integers(1).tolist()
    else:
        shape = [blob.integer(number) for number in _LEGACY_DIMS]
    if _DOUBLE_DATA in blob:
        values = blob.reals(_DOUBLE_DATA, np.float64)
    else:
        values = blob.reals(_DATA, np.float32)
    if not values.size or min(shape, default=1) < 0 or math.prod(shape) != values.size:
        raise ValueError(f"a blob of shape {shape} has {values.size} values")
    return values.reshape(shape)
