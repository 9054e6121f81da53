"""Readers of other programs' weight files, without those programs and without running code.

One module per format. `read_weights` looks at a file's first bytes, never at its name, and hands
it to the right one. Whatever the file holds, the outcome is its arrays or an `InputError`:
sizes that a file claims are compared with the bytes it has before memory is asked for.

To add a format: one module with ``recognise(head, path)`` and ``read(path)``, one line in
`_readers`, and one row in the tests of damaged files.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from retraverse.errors import InputError
from retraverse.weights.readers import (
    caffemodel,
    keras,
    matlab,
    matlab_hdf5,
    numpy_arrays,
    onnx_file,
    safetensors_file,
    tensorflow,
    tflite,
    torch_file,
)
from retraverse.weights.readers.guard import read_head
from retraverse.weights.weight_file import WeightFile

__all__ = ["read_weights"]


def read_weights(path: Path | str) -> WeightFile:
    """Read the arrays of a weight file, whichever of the known formats it has.

    Parameters
    ----------
    path : Path or str
        A caffemodel or binaryproto mean, MATLAB ``.mat``, frozen TensorFlow graph, Keras
        HDF5, PyTorch checkpoint, ``.tflite``, ``.onnx``, safetensors or ``.npz`` file. Its
        name does not matter.

    Raises
    ------
    DataMissingError
        If there is no such file.
    InputError
        If the file is damaged, of no known format, or would have to run code to be read.
    MissingExtraError
        If the format needs h5py or scipy and they are not installed.
    """
    path = Path(path)
    head = read_head(path)
    for reader in _readers:
        if reader.recognise(head, path):
            return reader.read(path)
    raise InputError(f"{path} is {_known_stranger(head)}")


class _Reader(NamedTuple):
    recognise: Callable[[bytes, Path], bool]
    read: Callable[[Path], WeightFile]


# The most telling starts first; protobuf messages, which have no start of their own, last.
_readers = (
    _Reader(numpy_arrays.recognise_npy, numpy_arrays.read_npy),
    _Reader(numpy_arrays.recognise_npz, numpy_arrays.read_npz),
    _Reader(torch_file.recognise_zip, torch_file.read_zip),
    _Reader(matlab.recognise, matlab.read),
    _Reader(matlab_hdf5.recognise, matlab_hdf5.read),
    _Reader(keras.recognise, keras.read),
    _Reader(tflite.recognise, tflite.read),
    _Reader(safetensors_file.recognise, safetensors_file.read),
    _Reader(torch_file.recognise_pickle, torch_file.read_pickle),
    _Reader(onnx_file.recognise, onnx_file.read),
    _Reader(tensorflow.recognise, tensorflow.read),
    _Reader(caffemodel.recognise, caffemodel.read),
)


def _known_stranger(head: bytes) -> str:
    """Say what a file is that no reader knows."""
    if head.startswith(b"\x08\x01\x12"):
        return "a TensorFlow SavedModel, not a frozen graph: freeze it, or give its Keras .h5"
    text = head.lstrip()[:200].lower()
    if text.startswith((b"<!doctype", b"<html")):
        return "a web page, not weights: the address gave a page in place of the file"
    if text.startswith(b"version https://git-lfs"):
        return "a pointer of Git LFS, not weights: fetch the file itself with git lfs pull"
    if text.startswith((b"name:", b"layer", b"input:", b"#")):
        return "text, like a prototxt: that is the graph; the weights are in its .caffemodel"
    if head.startswith((b"\x1f\x8b", b"BZh", b"\xfd7zXZ")) or head[257:262] == b"ustar":
        return "a packed archive: unpack it and give the weight file in it"
    return (
        "no weight file of a known format: expected caffemodel, binaryproto, .mat, frozen .pb,"
        " Keras .h5, PyTorch, .tflite, .onnx, safetensors or .npz"
    )
