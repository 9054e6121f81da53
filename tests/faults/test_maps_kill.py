"""Kill -9 at any instant leaves the old map or the new one, and the next writer clears up."""

import functools
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.faults import maps_writer
from tests.unit.maps.fakes import Snapshot, fake_registered, snapshot

from retraverse.maps import load_map

ROOT = Path(__file__).resolve().parents[2]
LONGEST_LIFE_S = 0.06
"""A writer needs 5 to 10 ms a map: this hits the first and the tenth."""


@pytest.fixture(autouse=True)
def _fake() -> Iterator[None]:
    with fake_registered():
        yield


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, maps_writer.__file__, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
    )


class Victim:
    """A process that forks writers; see `maps_writer`."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.process = start("random", str(folder), str(seed))
        assert self.process.stdin
        assert self.process.stdout
        self.asks, self.says = self.process.stdin, self.process.stdout

    def live_and_die(self, life_s: float) -> list[list[Any]]:
        """Start a writer, kill it after its first word and `life_s`; return what it said."""
        self.asks.write("go\n")
        said: list[list[Any]] = []
        # The forker and the writer speak into one pipe, in any order.
        while not {"pid"} < {word[0] for word in said}:
            said.append(json.loads(self.says.readline()))
        pid = next(word[1] for word in said if word[0] == "pid")
        time.sleep(life_s)
        os.kill(pid, signal.SIGKILL)
        while said[-1][0] != "ended":
            said.append(json.loads(self.says.readline()))
        assert os.WIFSIGNALED(said[-1][1]), "the writer ended by itself"
        return [word for word in said if word[0] in ("begin", "done")]


@functools.cache
def expected(variant: int, n_frames: int) -> Snapshot:
    return maps_writer.expected((variant, n_frames))


def check(folder: Path, said: list[list[Any]], grown: maps_writer.State | None) -> tuple[Any, bool]:
    """Check all maps of a killed writer; return the growing one's state, and if it was at work."""
    last = said[-1]
    for word, name, _, new in said:
        done = word == "done"
        if name == "grown.map":
            grown = tuple(new) if done else grown
            continue
        left = maps_writer.state_of(folder / name)
        assert left == tuple(new) or (left is None and not done and last[1] == name)
        if left is not None:
            assert snapshot(load_map(folder / name)) == expected(*left)
    left = maps_writer.state_of(folder / "grown.map")
    mid_way = last[0] == "begin"
    if mid_way and last[1] == "grown.map":
        assert left in (grown, tuple(last[3])), f"found {left}, expected {grown} or {last[3]}"
    else:
        assert left == grown, f"found {left}, expected {grown}"
    if left is not None:
        assert snapshot(load_map(folder / "grown.map")) == expected(*left)
    return left, mid_way


@pytest.mark.heavy
def test_kills_at_random_instants(tmp_path: Path, scaled: Callable[[int], int]) -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    generator = random.Random(seed)
    victim = Victim(tmp_path, seed)
    grown: Any = None
    interrupted = 0
    for _ in range(scaled(200)):
        said = victim.live_and_die(generator.uniform(0, LONGEST_LIFE_S))
        grown, mid_way = check(tmp_path, said, grown)
        interrupted += mid_way
    victim.asks.close()
    assert victim.process.wait(60) == 0
    victim.says.close()
    assert interrupted, "not one kill hit a writer at work: this would test nothing"
    # The next writers leave nothing of what was interrupted, neither beside nor inside.
    for partial in tmp_path.glob(".*.partial"):
        place = tmp_path / partial.name.removeprefix(".").removesuffix(".partial")
        maps_writer.build(place, (0, 1), overwrite=True)
    route = maps_writer.build(tmp_path / "grown.map", (0, 9), overwrite=True)
    assert not list(tmp_path.glob(".*"))
    assert len(list((tmp_path / "grown.map").rglob("*"))) == 3 + route.info()["n_segments"]


@pytest.mark.heavy
def test_a_kill_at_every_system_call(tmp_path: Path, scaled: Callable[[int], int]) -> None:
    """The same, with no chance left: a process dies at each call that changes the disk."""
    step = max(1, 5 // scaled(5))
    first = random.randint(1, step)
    print(f"first {first}, step {step}")
    process = start("points", str(tmp_path / "points"), str(first), str(step))
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    (killed,) = json.loads(output)
    assert killed.keys() == {"fresh", "extend", "replace", "same again"}
    # Two segments alone are opened, written in pieces, flushed and renamed.
    assert min(killed.values()) > 30 // step, killed
