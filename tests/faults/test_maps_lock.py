"""Two processes and one map: one writes, the other is told so, and readers notice nothing."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.faults import maps_writer
from tests.unit.maps.fakes import FakeTechnique, fake_registered, frames, snapshot

from retraverse.errors import MapError
from retraverse.maps import build_map, load_map

ROOT = Path(__file__).resolve().parents[2]
SLOW_WRITER = """
import sys
from tests.unit.maps import fakes
from retraverse.maps import build_map, load_map

class Slow(fakes.FakeTechnique):
    def describe(self, image):
        print("at work", flush=True)
        sys.stdin.readline()
        return super().describe(image)

verb, path = sys.argv[1:]
if verb == "extend":
    load_map(path, technique=Slow()).extend(fakes.frames(1, first=4), threads=1)
else:
    build_map(fakes.frames(1), Slow(), path=path, overwrite=verb == "replace", threads=1)
"""


@pytest.fixture(autouse=True)
def _fake() -> Iterator[None]:
    with fake_registered():
        yield


@pytest.mark.parametrize("verb", ["build", "extend", "replace"])
def test_the_second_writer_is_told(verb: str, tmp_path: Path) -> None:
    place = tmp_path / "route.map"
    before = None
    if verb != "build":
        before = snapshot(build_map(frames(4), FakeTechnique(), path=place))
    writer = subprocess.Popen(
        [sys.executable, "-c", SLOW_WRITER, verb, str(place)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert writer.stdout
    assert writer.stdout.readline() == "at work\n"
    with pytest.raises(MapError) as caught:
        build_map(frames(2), FakeTechnique(), path=place, overwrite=True)
    assert str(caught.value).endswith("another process is writing this map; wait until it is done")
    if before is not None:
        reader = load_map(place)
        assert snapshot(reader) == before
        with pytest.raises(MapError, match="another process is writing"):
            reader.extend(frames(1))
    writer.communicate("\n", timeout=30)
    assert writer.returncode == 0
    assert len(load_map(place)) == {"build": 1, "extend": 5, "replace": 1}[verb]
    assert list(tmp_path.iterdir()) == [place]


def test_a_map_that_appears_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    place = tmp_path / "route.map"

    class Rival(FakeTechnique):
        def describe(self, image):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
            if not place.exists():
                build_map(frames(3), FakeTechnique()).save(tmp_path / "rival.map")
                (tmp_path / "rival.map").rename(place)
            return super().describe(image)

    with pytest.raises(MapError, match="cannot be written"):
        build_map(frames(1), Rival(), path=place, threads=1)
    assert len(load_map(place)) == 3
    assert list(tmp_path.iterdir()) == [place]


def test_readers_never_see_a_map_half_replaced(tmp_path: Path) -> None:
    """Load over and over while another process grows and replaces the map."""
    place = tmp_path / "grown.map"
    maps_writer.build(place, (0, 3))
    with (tmp_path / "said").open("wb") as said:
        writer = subprocess.Popen(
            [sys.executable, maps_writer.__file__, "random", str(tmp_path), "7"],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE,
            stdout=said,
        )
    assert writer.stdin
    writer.stdin.write(b"go\n")
    writer.stdin.flush()
    try:
        lengths: set[int] = set()
        n_loaded, end = 0, time.monotonic() + 60
        # However slowly the writer starts: until it was seen at work.
        while n_loaded < 300 or (len(lengths) <= 2 and time.monotonic() < end):
            route = load_map(place)
            lengths.add(len(route))
            n_loaded += 1
            assert snapshot(route)["frames"]
    finally:
        stop(writer, tmp_path / "said")
    assert len(lengths) > 2, "nothing changed while we looked"


def stop(writer: subprocess.Popen[bytes], said: Path) -> None:
    """End the process that writes, and then the one that started it."""
    try:
        end = time.monotonic() + 30
        while '["pid"' not in said.read_text() and time.monotonic() < end:
            time.sleep(0.01)
        lines = said.read_text().splitlines()
        (child,) = (json.loads(line)[1] for line in lines if line.startswith('["pid"'))
        os.kill(child, signal.SIGKILL)
        assert writer.stdin
        writer.stdin.close()
        assert writer.wait(30) == 0
    finally:
        writer.kill()
