"""Damaged weight files of every format: arrays or one clear error, whatever the bytes."""

import contextlib
import faulthandler
import random
import resource
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers.samples import SAMPLES, random_arrays, written

from retraverse.errors import InputError
from retraverse.weights.readers import apart, read_weights

SLOWEST_S = 20.0
"""For one small file on a busy machine; the median is some milliseconds."""
ENDLESS_SEED = 5000254
MOST_MEMORY_KB = 400_000
RUNNING = {"os.system", "os.exec", "os.posix_spawn", "os.spawn", "subprocess.Popen"}
CALLING = {"pickle.find_class", "socket.connect", "ctypes.dlopen"}

_ran: list[str] = []


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if event in RUNNING | CALLING and not _is_our_own(event, arguments):
        _ran.append(event)


def _is_our_own(event: str, arguments: tuple[object, ...]) -> bool:
    """Tell the process that reads HDF5, by its program: what it is started with, not by."""
    if event != "subprocess.Popen":
        return False
    words = arguments[1]
    return isinstance(words, list) and words[:3] == [sys.executable, "-c", apart._START]


@pytest.fixture(scope="module", autouse=True)
def _what_runs_is_seen() -> None:
    sys.addaudithook(_watch)


@pytest.fixture(autouse=True)
def _no_hang_goes_unseen() -> Iterator[None]:
    # A reader that never ends cannot be stopped from Python; the whole run would hang.
    faulthandler.dump_traceback_later(3600, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


def cut_off(content: bytearray, chance: random.Random) -> bytes:
    return bytes(content[: chance.randrange(len(content))])


def bytes_changed(content: bytearray, chance: random.Random) -> bytes:
    for _ in range(chance.randrange(1, 8)):
        content[chance.randrange(len(content))] = chance.randrange(256)
    return bytes(content)


def bit_flipped(content: bytearray, chance: random.Random) -> bytes:
    content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    return bytes(content)


def sizes_changed(content: bytearray, chance: random.Random) -> bytes:
    width = chance.choice([1, 2, 4, 8])
    numbers = [0, 1, 127, 128, (1 << 8 * width) - 1, (1 << 8 * width - 1) - 1, 1 << 8 * width - 4]
    place = chance.randrange(len(content))
    order = chance.choice(["little", "big"])
    content[place : place + width] = chance.choice(numbers).to_bytes(width, order)  # type: ignore[arg-type]
    return bytes(content)


def piece_removed(content: bytearray, chance: random.Random) -> bytes:
    place = chance.randrange(len(content))
    del content[place : place + chance.randrange(1, 64)]
    return bytes(content)


def piece_repeated(content: bytearray, chance: random.Random) -> bytes:
    place = chance.randrange(len(content))
    piece = content[place : place + chance.randrange(1, 64)]
    content[place:place] = piece * chance.randrange(1, 20)
    return bytes(content)


MUTATIONS: tuple[Callable[[bytearray, random.Random], bytes], ...] = (
    cut_off,
    bytes_changed,
    bit_flipped,
    sizes_changed,
    piece_removed,
    piece_repeated,
)


@pytest.mark.heavy
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("kind", SAMPLES)
def test_damaged_file_is_read_or_refused(
    kind: str, tmp_path: Path, scaled: Callable[[int], int]
) -> None:
    sample = SAMPLES[kind]()
    read_weights(written(tmp_path, sample))  # Undamaged, it is read; heavy imports are behind us.
    seed = secrets.randbits(32)
    print(f"{kind}: seed {seed}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    _ran.clear()
    messages: list[str] = []
    # Each takes a process where the parser is not ours: a fifth of them unless in full.
    is_slow = kind in ("keras", "matlab 7.3") and scaled(1000) < 1000
    for i in range(scaled(200 if is_slow else 1000)):
        chance = random.Random(seed + i)
        path = written(tmp_path, chance.choice(MUTATIONS)(bytearray(sample), chance))
        start = time.monotonic()
        try:
            weights = read_weights(path)
        except InputError as error:
            messages.append(str(error))
        else:
            assert all(isinstance(array, np.ndarray) for array in weights.tensors.values())
            assert all(type(key) is type(text) is str for key, text in weights.metadata.items())
        assert time.monotonic() - start < SLOWEST_S, f"mutation {i}"
        assert not _ran, f"mutation {i}"
    assert messages
    assert all(str(path) in message and "\n" not in message for message in messages)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < MOST_MEMORY_KB


def test_libhdf5_that_never_ends_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file on which libhdf5 1.14 loops for ever, reading an attribute."""
    monkeypatch.setattr(apart, "LONGEST_S", 5.0)
    chance = random.Random(ENDLESS_SEED)
    content = chance.choice(MUTATIONS)(bytearray(SAMPLES["keras"]()), chance)
    start = time.monotonic()
    with contextlib.suppress(InputError):  # Other versions may read or refuse it.
        read_weights(written(tmp_path, content))
    assert time.monotonic() - start < SLOWEST_S


def test_any_bytes_are_refused(tmp_path: Path, scaled: Callable[[int], int]) -> None:
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    starts = [SAMPLES[kind]()[:16] for kind in SAMPLES]
    for i in range(scaled(1000)):
        chance = random.Random(seed + i)
        content = chance.choice([b"", *starts]) + chance.randbytes(chance.randrange(1, 400))
        with pytest.raises(InputError):
            read_weights(written(tmp_path, content))


def test_the_watch_sees_code_that_runs(tmp_path: Path) -> None:
    import pickle

    sample = pickle.dumps(random_arrays())
    _ran.clear()
    pickle.loads(sample)
    assert "pickle.find_class" in _ran
    _ran.clear()
