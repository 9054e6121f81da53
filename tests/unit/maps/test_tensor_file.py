"""Our safetensors files against the package of that name, both ways; and what is refused."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.numpy

from retraverse.errors import MapError
from retraverse.maps.tensor_file import FileSeal, map_tensors, write_tensors
from retraverse.types import Array

DTYPES = [
    "bool",
    "uint8",
    "int8",
    "uint16",
    "int16",
    "float16",
    "uint32",
    "int32",
    "float32",
    "uint64",
    "int64",
    "float64",
]
TENSORS: dict[str, Array] = {
    dtype: np.arange(7 * 3).reshape(7, 3).astype(dtype) for dtype in DTYPES
} | {"none": np.zeros((0, 5), np.float32), "scalar": np.array(2.5)}
SPECS = {name: (array.dtype.name, array.shape) for name, array in TENSORS.items()}


def write(path: Path, tensors: dict[str, Array]) -> FileSeal:
    target = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    try:
        return write_tensors(target, tensors)
    finally:
        os.close(target)


def read(path: Path, specs: Any, *, verify: bool = True, **seal: Any) -> dict[str, Array]:
    content = path.read_bytes()
    expected: dict[str, Any] = {
        "size": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
    } | seal
    file = os.open(path, os.O_RDONLY)
    try:
        return map_tensors(file, FileSeal(**expected), specs, what="x.st", verify=verify)
    finally:
        os.close(file)


def same(got: dict[str, Array], expected: dict[str, Array]) -> bool:
    return got.keys() == expected.keys() and all(
        got[name].dtype == array.dtype and np.array_equal(got[name], array)
        for name, array in expected.items()
    )


def test_the_safetensors_package_reads_ours(tmp_path: Path) -> None:
    seal = write(tmp_path / "x", TENSORS)
    content = (tmp_path / "x").read_bytes()
    assert seal == FileSeal(len(content), hashlib.sha256(content).hexdigest())
    assert same(safetensors.numpy.load(content), TENSORS)


def test_we_read_the_safetensors_package(tmp_path: Path) -> None:
    safetensors.numpy.save_file(TENSORS, tmp_path / "x", metadata={"made": "elsewhere"})
    assert same(read(tmp_path / "x", SPECS), TENSORS)


def test_arrays_are_aligned_read_only_and_outlive_the_file(tmp_path: Path) -> None:
    write(tmp_path / "x", TENSORS)
    got = read(tmp_path / "x", SPECS)
    (tmp_path / "x").unlink()
    assert same(got, TENSORS)
    for array in got.values():
        assert array.flags.aligned
        assert array.flags.c_contiguous
        assert not array.flags.writeable


def test_nothing_is_copied(tmp_path: Path) -> None:
    big = {"big": np.ones((64, 1 << 18), np.float32)}
    write(tmp_path / "x", big)
    before = _anonymous_kilobytes()
    got = read(tmp_path / "x", {"big": ("float32", (64, 1 << 18))}, verify=False, sha256="")
    assert got["big"][5, 5] == 1
    assert _anonymous_kilobytes() - before < 8 << 10, "64 MB mapped should cost no memory"


def _anonymous_kilobytes() -> int:
    status = Path("/proc/self/status")
    if not status.exists():
        pytest.skip("no /proc to measure memory with")
    lines = status.read_text().splitlines()
    return int(next(line for line in lines if line.startswith("RssAnon")).split()[1])


def test_strided_and_big_endian_arrays_are_written_straight(tmp_path: Path) -> None:
    tensors = {"strided": np.arange(20.0).reshape(4, 5)[:, ::2], "big": np.arange(3, dtype=">i4")}
    write(tmp_path / "x", tensors)
    got = safetensors.numpy.load_file(tmp_path / "x")
    assert np.array_equal(got["strided"], tensors["strided"])
    assert np.array_equal(got["big"], [0, 1, 2])


def test_size_and_checksum_decide(tmp_path: Path) -> None:
    write(tmp_path / "x", TENSORS)
    size = (tmp_path / "x").stat().st_size
    with pytest.raises(MapError, match=rf"x\.st: truncated: got {size} bytes, expected {size + 1}"):
        read(tmp_path / "x", SPECS, size=size + 1)
    with pytest.raises(MapError, match=r"x\.st: has grown"):
        read(tmp_path / "x", SPECS, size=size - 1)
    with pytest.raises(MapError, match=r"x\.st: its checksum is not the manifest's"):
        read(tmp_path / "x", SPECS, sha256="0" * 64)


def container(header: Any, data: bytes) -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def entry(dtype: Any = "U8", shape: Any = (4,), offsets: Any = (0, 4)) -> dict[str, Any]:
    return {"dtype": dtype, "shape": shape, "data_offsets": offsets}


FOREIGN = {
    "header too long": (9).to_bytes(8, "little") + b"{}",
    "header huge": (1 << 62).to_bytes(8, "little") + b"{}",
    "no json": container(b"\xff\xfe", b""),
    "deep json": container(b"[" * 100_000, b""),
    "a list": container([], b"abcd"),
    "other names": container({"b": entry()}, b"abcd"),
    "no entry": container({"a": 5}, b"abcd"),
    "no dtype": container({"a": {"shape": [4], "data_offsets": [0, 4]}}, b"abcd"),
    "other dtype": container({"a": entry("I8")}, b"abcd"),
    "list for dtype": container({"a": entry(["U8"])}, b"abcd"),
    "other shape": container({"a": entry(shape=[2, 2])}, b"abcd"),
    "shorter": container({"a": entry(shape=[3], offsets=[0, 3])}, b"abc"),
    "negative": container({"a": entry(offsets=[-4, 0])}, b"abcd"),
    "true for one": container({"a": entry(shape=[True])}, b"a"),
    "float shape": container({"a": entry(shape=[4.0])}, b"abcd"),
    "past the end": container({"a": entry()}, b"abc"),
    "gap before": container({"a": entry(offsets=[1, 5])}, b"xabcd"),
    "more behind": container({"a": entry()}, b"abcdx"),
    "three offsets": container({"a": entry(offsets=[0, 4, 4])}, b"abcd"),
    "no offsets": container({"a": entry(offsets=None)}, b"abcd"),
}


@pytest.mark.parametrize("content", FOREIGN.values(), ids=FOREIGN.keys())
def test_foreign_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x").write_bytes(content)
    with pytest.raises(MapError, match=r"^x\.st: .*damaged or foreign$"):
        read(tmp_path / "x", {"a": ("uint8", (4,))})


def test_the_same_header_is_accepted_when_it_is_right(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(container({"a": entry()}, b"abcd"))
    assert read(tmp_path / "x", {"a": ("uint8", (4,))})["a"].tobytes() == b"abcd"
    assert read(tmp_path / "x", {"a": ("uint8", (None,))})["a"].tobytes() == b"abcd"
