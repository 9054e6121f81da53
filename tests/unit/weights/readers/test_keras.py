"""Keras HDF5 files, against h5py read plainly."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights

h5py = pytest.importorskip("h5py")


def test_names_are_paths_below_the_weights(tmp_path: Path) -> None:
    written = samples.random_arrays()
    weights = read_weights(samples.written(tmp_path, samples.keras(written)))
    assert weights.metadata["keras_version"] == "2.2.4"
    assert set(weights.tensors) == {"conv1/conv1/0:0", "conv1/conv1/1:0", "fc/fc/0:0", "fc/fc/1:0"}
    np.testing.assert_array_equal(weights.tensors["fc/fc/0:0"], written["fc.0"])


def test_links_to_other_files_are_left_alone(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = np.ones(3)
    path = tmp_path / "weights.h5"
    with h5py.File(path, "w") as file:
        file["mine"] = np.arange(3.0)
        file["link"] = h5py.ExternalLink("other.h5", "secret")
        file["soft"] = h5py.SoftLink("/mine")
    assert set(read_weights(path).tensors) == {"mine"}


def test_values_in_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "raw.bin").write_bytes(bytes(80))
    path = tmp_path / "weights.h5"
    with h5py.File(path, "w") as file:
        outside = [(str(tmp_path / "raw.bin"), 0, 80)]
        file.create_dataset("a", shape=(10,), dtype="f8", external=outside)
    with pytest.raises(InputError, match="other files"):
        read_weights(path)


def test_claimed_terabytes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "weights.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", shape=(1 << 40,), dtype="f4", chunks=(1 << 10,))
    with pytest.raises(InputError, match="more than so many bytes"):
        read_weights(path)


def test_a_group_that_contains_itself_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "weights.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("a")
        group["again"] = group
    with pytest.raises(InputError, match="contain itself"):
        read_weights(path)


def test_real_file_equals_h5py_and_the_frozen_graph(shared: Callable[[str], Path]) -> None:
    folder = shared("weights/mobilenetv2_netvlad")
    path = folder / "modelarch_and_weights.800.h5"
    tensors = read_weights(path).tensors
    frozen = read_weights(folder / "modelarch_and_weights.800.480x640x3.pb").tensors
    with h5py.File(path, "r") as file:
        expected = {}
        file["model_weights"].visititems(
            lambda name, item: expected.update({name: item[()]} if hasattr(item, "dtype") else {})
        )
    assert len(tensors) == len(expected) == 153
    for name, array in expected.items():
        np.testing.assert_array_equal(tensors[name], array)
        variable = name.partition("/")[2].removesuffix(":0")
        if variable.startswith("net_vlad"):
            continue
        np.testing.assert_array_equal(frozen[variable], array)
