"""Pickles that want to run something: refused by name, and nothing has run."""

import io
import os
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights

CANARY = "RETRAVERSE_TEST_CANARY"


class Calls:
    """An object whose pickle calls a function."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self.call


def as_zip(content: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("archive/data.pkl", content)
        archive.writestr("archive/data/0", bytes(64))
        archive.writestr("../../escaped", b"outside")
    return stream.getvalue()


def as_legacy(content: bytes) -> bytes:
    head = (0x1950A86A20F9469CFC6C, 1001, {"little_endian": True})
    return b"".join(pickle.dumps(part, 2) for part in head) + content + pickle.dumps([], 2)


CONTAINERS: dict[str, Callable[[bytes], bytes]] = {
    "plain": bytes,
    "zip": as_zip,
    "legacy": as_legacy,
}
SET = (os.putenv, CANARY, "ran")
CALLS: dict[str, tuple[Any, str]] = {
    "os.system": (Calls(os.system, "touch ran"), "system"),
    "os.putenv": (Calls(*SET), "putenv"),
    "eval": (Calls(eval, "1 + 1"), "eval"),
    "exec": (Calls(exec, "import os"), "exec"),
    "getattr": (Calls(getattr, Calls(__import__, "os"), "system"), "__import__|getattr"),
    "in a state dict": ({"state_dict": {"w": Calls(os.system, "touch ran")}}, "system"),
    "as a key": ({"a": [(1, Calls(*SET))]}, "putenv"),
    "open": (Calls(open, "ran", "w"), "open"),
}


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("protocol", [0, 2, 5])
@pytest.mark.parametrize("call", CALLS)
def test_a_call_is_refused_by_name(
    call: str, protocol: int, container: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content, named = CALLS[call]
    path = samples.written(tmp_path, CONTAINERS[container](pickle.dumps(content, protocol)))
    with pytest.raises(InputError, match=named) as caught:
        read_weights(path)
    assert "would run code" in str(caught.value)
    assert str(path) in str(caught.value)
    assert sorted(tmp_path.iterdir()) == [path]
    assert CANARY not in os.environ


SYSTEM = b"cos\nsystem\n"
TORCH = b"ctorch._utils\n_rebuild_tensor_v2\n"
ORDERED = b"ccollections\nOrderedDict\n"
STORAGE = (
    b"(X\x07\x00\x00\x00storagectorch\nFloatStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuK\x10t"
)
BY_HAND = {
    "INST": (b"(S'touch ran'\nios\nsystem\n.", "os.system"),
    "OBJ": (b"(" + SYSTEM + b"S'touch ran'\no.", "os.system"),
    "NEWOBJ": (b"\x80\x02" + SYSTEM + b")\x81.", "os.system"),
    "NEWOBJ_EX": (b"\x80\x04" + ORDERED + b")}(K\x01K\x02u\x92.", "with keywords"),
    "EXT1": (b"\x80\x02\x82\x01.", "EXT1"),
    "EXT4": (b"\x80\x02\x84\x01\x00\x00\x00.", "EXT4"),
    "STACK_GLOBAL": (b"\x80\x04\x8c\x02os\x8c\x06system\x93.", "os.system"),
    "STACK_GLOBAL of numbers": (b"\x80\x04K\x01K\x02\x93.", "no text"),
    "dots in a name": (b"\x80\x04\x8c\x0bcollections\x8c\x14OrderedDict.__init__\x93.", "run code"),
    "name below an allowed one": (b"\x80\x02ctorch.nn\nModule\n.", "torch.nn.Module"),
    "hub": (b"\x80\x02ctorch.hub\nload\n.", "torch.hub.load"),
    "numpy's loader": (b"\x80\x02cnumpy\nload\n.", "numpy.load"),
    "global within arguments": (b"\x80\x02(((" + SYSTEM + b"ttt.", "os.system"),
    "never used": (b"\x80\x02" + SYSTEM + b"0N.", "os.system"),
    "calls a text": (b"\x80\x02X\x02\x00\x00\x00os)R.", "calls what is no known name"),
    "state on a name": (b"\x80\x02" + ORDERED + b"}(X\x01\x00\x00\x00aK\x01ub.", "what has none"),
    "buffer outside": (b"\x80\x05\x97.", "NEXT_BUFFER"),
    "persistent number": (b"\x80\x02K\x01Q.", "no storage"),
    "persistent text": (b"\x80\x02X\x07\x00\x00\x00storageQ.", "no storage"),
    "persistent list": (b"\x80\x02]Q.", "no storage"),
    "persistent line": (b"Pstorage\n.", "known format|no storage"),
    "persistent of a wrong kind": (STORAGE.replace(b"storage", b"garbage") + b"Q.", "no storage"),
    "storage of objects": (STORAGE.replace(b"FloatStorage", b"float32") + b"Q.", "plain numbers"),
    "tensor without storage": (b"\x80\x02" + TORCH + b"(NK\x00))\x89}tR.", "no storage"),
    "tensor beyond its storage": (
        b"\x80\x02" + TORCH + b"(" + STORAGE + b"QK\x08K\x09\x85K\x01\x85\x89}tR.",
        "reaches to number 16 of 16|not in it",
    ),
    "tensor of terabytes": (
        b"\x80\x02" + TORCH + b"(" + STORAGE + b"QK\x00J\xff\xff\xff\x7f\x85K\x00\x85\x89}tR.",
        "more than so many bytes|not in it",
    ),
    "tensor before its storage": (
        b"\x80\x02" + TORCH + b"(" + STORAGE + b"QJ\xff\xff\xff\xffK\x01\x85K\x01\x85\x89}tR.",
        "no storage",
    ),
    "key that is a tuple": (b"\x80\x02}" + b")" + b"\x85" * 5 + b"K\x01s.", "expected a scalar"),
    "mark for a value": (b"\x80\x02(R.", "mark"),
    "memo never written": (b"\x80\x02h\x05.", "5"),
    "never ends": (b"\x80\x02]" + b"N0" * 50, "exhausted|does not end"),
}


@pytest.mark.parametrize("container", ["plain", "zip"])
@pytest.mark.parametrize("case", BY_HAND)
def test_pickles_by_hand(
    case: str, container: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content, reason = BY_HAND[case]
    with pytest.raises(InputError, match=reason):
        read_weights(samples.written(tmp_path, CONTAINERS[container](content)))
    assert len(list(tmp_path.iterdir())) == 1


def nested(depth: int) -> bytes:
    return b"\x80\x02" + b"(" * depth + b"N" + b"t" * depth + b"."


def doubling(levels: int) -> bytes:
    """Return lists of twice the same list: 2 to the power of `levels` values in 5 bytes each."""
    return (
        b"\x80\x02]q\x00"
        + b"".join(
            b"](h" + bytes([i]) + b"h" + bytes([i]) + b"eq" + bytes([i + 1]) for i in range(levels)
        )
        + b"."
    )


BOMBS = {
    "deep": nested(50_000),
    "doubling": doubling(60),
    "contains itself": b"\x80\x02]q\x00h\x00a.",
    "copies": b"\x80\x02X"
    + (100_000).to_bytes(4, "little")
    + b"x" * 100_000
    + b"q\x000"
    + (b"c_codecs\nencode\nh\x00X\x06\x00\x00\x00latin1\x86R0" * 5_000 + b"N."),
    "claimed text": b"\x80\x04\x8d" + (1 << 40).to_bytes(8, "little") + b"abc",
    "claimed integer": b"\x80\x02\x8b" + (1 << 30).to_bytes(4, "little") + b"abc",
    "long decimal": b"\x80\x02L" + b"9" * 100_000 + b"L\n.",
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_bombs_are_refused(bomb: str, tmp_path: Path) -> None:
    for container in (bytes, as_zip):
        with pytest.raises(InputError):
            read_weights(samples.written(tmp_path, container(BOMBS[bomb])))


def test_zip_bomb_is_refused(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        storage = STORAGE.replace(b"K\x10", b"J\x00\x00\x80\x00")
        tensor = b"(" + storage + b"QK\x00J\x00\x00\x80\x00\x85K\x01\x85\x89}tR."
        archive.writestr("archive/data.pkl", b"\x80\x02" + TORCH + tensor)
        with archive.open("archive/data/0", "w", force_zip64=True) as file:
            for _ in range(32):
                file.write(bytes(1 << 20))
    with pytest.raises(InputError, match="more than so many bytes"):
        read_weights(samples.written(tmp_path, stream.getvalue()))


def test_a_storage_is_not_looked_for_outside_of_the_archive(tmp_path: Path) -> None:
    storage = STORAGE.replace(b"X\x01\x00\x00\x000", b"X\x10\x00\x00\x00../../../escaped")
    tensor = b"\x80\x02" + TORCH + b"(" + storage + b"QK\x00K\x01\x85K\x01\x85\x89}tR."
    with pytest.raises(InputError, match=r"\.\./\.\./\.\./escaped"):
        read_weights(samples.written(tmp_path, as_zip(tensor)))
