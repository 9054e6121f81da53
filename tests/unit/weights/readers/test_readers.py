"""Which reader takes a file, and what is said of files that are no weights."""

from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import DataMissingError, InputError
from retraverse.weights.readers import read_weights

FORMATS = {
    "caffemodel": "caffemodel",
    "caffemodel V1": "caffemodel",
    "binaryproto": "caffemodel",
    "tensorflow": "tensorflow",
    "keras": "keras",
    "matlab": "matlab",
    "matlab compressed": "matlab",
    "matlab 7.3": "matlab",
    "torch": "torch",
    "torch legacy": "torch",
    "pickle": "pickle",
    "pickle 0": "pickle",
    "tflite": "tflite",
    "safetensors": "safetensors",
    "npz": "npz",
    "npy": "npz",
    "onnx": "onnx",
}


@pytest.mark.parametrize("kind", samples.SAMPLES)
def test_format_is_told_by_content_and_arrays_are_native(kind: str, tmp_path: Path) -> None:
    path = samples.written(tmp_path, samples.SAMPLES[kind](), "misleading.jpg")
    weights = read_weights(str(path))
    assert weights.format == FORMATS[kind]
    for array in weights.tensors.values():
        assert array.dtype.isnative
        assert array.flags.c_contiguous


STRANGERS = {
    "web page": (b"<!DOCTYPE html><html>sign in</html>", "web page"),
    "git lfs": (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    "prototxt": (b'name: "CALC"\nlayer { name: "conv1" }\n', "prototxt"),
    "tar.gz": (b"\x1f\x8b\x08" + bytes(50), "unpack it"),
    "SavedModel": (b"\x08\x01\x12\x04\x0a\x02\x10\x01", "freeze it"),
    "text": (b"hello, world", "expected caffemodel"),
    "empty": (b"", "is empty"),
}


@pytest.mark.parametrize("kind", STRANGERS)
def test_stranger_is_named(kind: str, tmp_path: Path) -> None:
    content, hint = STRANGERS[kind]
    with pytest.raises(InputError, match=hint):
        read_weights(samples.written(tmp_path, content))


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no weight file"):
        read_weights(tmp_path / "none.pth")
    with pytest.raises(InputError, match="is not a file"):
        read_weights(tmp_path)


@pytest.mark.parametrize("kind", ["npz", "npy", "safetensors", "onnx"])
def test_arrays_are_those_written(kind: str, tmp_path: Path) -> None:
    written = samples.random_arrays()
    expected = {"array": written["conv1.0"]} if kind == "npy" else written
    tensors = read_weights(samples.written(tmp_path, samples.SAMPLES[kind]())).tensors
    assert set(tensors) == set(expected)
    for name, array in expected.items():
        np.testing.assert_array_equal(tensors[name], array)


@pytest.mark.parametrize(
    "array", [np.array([{}], object), np.array(["text"]), np.zeros(2, "f4,i4")]
)
def test_npy_of_what_is_no_numbers_is_refused(array: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, array, allow_pickle=True)
    with pytest.raises(InputError, match="objects need code"):
        read_weights(path)


@pytest.mark.parametrize("dtype", ["?", "i1", "u2", ">i4", "u8", "f2", ">f8", "c8"])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3), (2, 3, 4)])
def test_npy_as_numpy_reads_it(dtype: str, shape: tuple[int, ...], tmp_path: Path) -> None:
    array = np.asfortranarray(np.arange(np.prod(shape)).reshape(shape).astype(dtype))
    path = tmp_path / "a.npy"
    np.save(path, array)
    np.testing.assert_array_equal(read_weights(path).tensors["array"], np.load(path))
