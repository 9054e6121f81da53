"""MATLAB files of both versions: version 5 against scipy, 7.3 against h5py."""

import zlib
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights

scipy_io = pytest.importorskip("scipy.io")


@pytest.mark.parametrize("compressed", [False, True])
def test_structs_and_cells_are_scipys(compressed: bool, tmp_path: Path) -> None:
    path = samples.written(tmp_path, samples.matlab(samples.random_arrays(), compressed))
    weights, scipys = read_weights(path), scipy_io.loadmat(path)
    cells = scipys["net"][0, 0]["layers"]
    expected = {f"net.layers.{i}": cells[0, i] for i in range(4)}
    expected |= {f"s.{i}.w": scipys["s"][0, i]["w"] for i in range(2)}
    assert set(weights.tensors) == set(expected)
    for name, array in expected.items():
        assert weights.tensors[name].dtype == array.dtype
        np.testing.assert_array_equal(weights.tensors[name], array)
    assert weights.metadata == {
        "net.meta.name": "vd16",
        "s.0.name": "layer 0",
        "s.1.name": "layer 1",
    }


@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 3), (2, 3), (2, 3, 4)])
def test_numbers_are_scipys(dtype: str, shape: tuple[int, ...], tmp_path: Path) -> None:
    array = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    path = tmp_path / "a.mat"
    scipy_io.savemat(path, {"a": array})
    expected = scipy_io.loadmat(path)["a"]
    got = read_weights(path).tensors["a"]
    # scipy gives logical arrays as uint8.
    assert got.dtype == array.dtype
    np.testing.assert_array_equal(got, expected)


def test_version_73(tmp_path: Path) -> None:
    written = samples.random_arrays()
    weights = read_weights(samples.written(tmp_path, samples.matlab_73(written)))
    assert weights.format == "matlab"
    assert weights.metadata == {"net.name": "vd16"}
    assert list(weights.tensors) == [f"net.layers.{i}" for i in range(4)]
    for got, array in zip(weights.tensors.values(), written.values(), strict=True):
        np.testing.assert_array_equal(got, array)


def test_sparse_and_complex_arrays_are_refused(tmp_path: Path) -> None:
    sparse = pytest.importorskip("scipy.sparse")
    cases = {"sparse": sparse.eye_array(3, format="csc"), "complex": np.array([1j])}
    for reason, array in cases.items():
        path = tmp_path / "a.mat"
        scipy_io.savemat(path, {"a": array})
        with pytest.raises(InputError, match=reason):
            read_weights(path)


def test_zlib_bomb_is_refused(tmp_path: Path) -> None:
    packed = zlib.compress(bytes(20 << 20), 9)
    element = (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little") + packed
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + element
    with pytest.raises(InputError, match="more than so many bytes"):
        read_weights(samples.written(tmp_path, content))
