"""Downloads cut, lied to, killed and resumed: the file is whole and right, or not there."""

import hashlib
import random
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.unit.weights.file_server import serving

from retraverse.errors import InputError
from retraverse.weights.checksum import Seal
from retraverse.weights.download import DownloadError, DownloadPlan, fetch, plan_download

CONTENT = random.Random(1).randbytes(300_000)
SHA256 = hashlib.sha256(CONTENT).hexdigest()
KNOWN = Seal(len(CONTENT), SHA256)


def plan(address: str, folder: Path, expected: Seal | None = None, **settings: Any) -> DownloadPlan:
    return plan_download(
        address, folder / "weights.bin", expected, pause_s=0.01, timeout_s=60.0, **settings
    )


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("length", [True, False], ids=["with length", "without"])
@pytest.mark.parametrize("expected", [KNOWN, None], ids=["checksum", "none"])
def test_whole_file_and_its_seal(tmp_path: Path, length: bool, expected: Seal | None) -> None:
    with serving(CONTENT, length=length) as server:
        seal = fetch(plan(server.address, tmp_path, expected))
    assert seal.sha256 == SHA256
    assert seal.n_bytes == len(CONTENT)
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT
    assert left_in(tmp_path) == ["weights.bin"]


def test_folder_is_made(tmp_path: Path) -> None:
    with serving(CONTENT) as server:
        fetch(plan(server.address, tmp_path / "new" / "folder"))
    assert (tmp_path / "new" / "folder" / "weights.bin").read_bytes() == CONTENT


@pytest.mark.parametrize("ranges", [True, False], ids=["ranges", "no ranges"])
def test_cut_connection_is_taken_up_again(tmp_path: Path, ranges: bool) -> None:
    with serving(CONTENT, cut_after=100_000, cuts=2, ranges=ranges) as server:
        fetch(plan(server.address, tmp_path, KNOWN))
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT
    assert server.asked == [None, "bytes=100000-", "bytes=200000-" if ranges else "bytes=100000-"]


def test_server_that_only_cuts_is_given_up_but_what_came_stays(tmp_path: Path) -> None:
    with serving(CONTENT, cut_after=50_000, cuts=99, ranges=False) as server:
        with pytest.raises(DownloadError, match=r"cut after 50000 of 300000 bytes.*carries on"):
            fetch(plan(server.address, tmp_path, KNOWN, attempts=3))
        assert left_in(tmp_path) == ["weights.bin.part", "weights.bin.part.json"]
        server.cuts, server.ranges = 0, True
        fetch(plan(server.address, tmp_path, KNOWN))
    assert server.asked[-1] == "bytes=50000-"
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT


def test_other_version_is_not_glued_to_the_first_half(tmp_path: Path) -> None:
    with serving(b"old" * 100_000, cut_after=50_000, cuts=9, ranges=False) as server:
        with pytest.raises(DownloadError):
            fetch(plan(server.address, tmp_path, attempts=1))
        server.content, server.cuts, server.ranges = CONTENT, 0, True
        fetch(plan(server.address, tmp_path))
    assert server.asked[-1] == "bytes=50000-"
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT


def test_halves_that_nothing_proves_to_belong_together_are_not_joined(tmp_path: Path) -> None:
    with serving(CONTENT, cut_after=50_000, cuts=1, version=None) as server:
        fetch(plan(server.address, tmp_path))
    assert server.asked == [None, None]
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT


def test_other_address_starts_anew(tmp_path: Path) -> None:
    with (
        serving(b"x" * 300_000, cut_after=50_000, cuts=9, ranges=False) as first,
        serving(CONTENT) as second,
    ):
        with pytest.raises(DownloadError):
            fetch(plan(first.address, tmp_path, attempts=1))
        fetch(plan(second.address, tmp_path, KNOWN))
    assert second.asked == [None]


def test_all_came_before_the_kill(tmp_path: Path) -> None:
    with serving(CONTENT) as server:
        ready = plan(server.address, tmp_path, KNOWN)
        ready.part.write_bytes(CONTENT)
        ready.record.write_text(f'{{"address": "{server.address}", "version": null}}')
        fetch(ready)
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT
    assert server.asked == ["bytes=300000-"]


def test_more_than_the_file_came_before(tmp_path: Path) -> None:
    with serving(CONTENT) as server:
        ready = plan(server.address, tmp_path, KNOWN)
        ready.part.write_bytes(CONTENT + b"more")
        ready.record.write_text(f'{{"address": "{server.address}", "version": null}}')
        fetch(ready)
    assert (tmp_path / "weights.bin").read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("expected", "message"),
    [
        (Seal(sha256="0" * 64), f"got SHA-256 {SHA256}, expected 000"),
        (Seal(sha1="0" * 40), "got SHA-1"),
        (Seal(git_blob="0" * 40), "got Git blob"),
        (Seal(n_bytes=7), "the server has 300000 bytes, expected 7"),
    ],
)
def test_wrong_content_is_refused_and_not_kept(
    tmp_path: Path, expected: Seal, message: str
) -> None:
    with serving(CONTENT) as server, pytest.raises(InputError, match=message):
        fetch(plan(server.address, tmp_path, expected))
    assert left_in(tmp_path) == []


def test_more_bytes_than_expected_are_not_taken(tmp_path: Path) -> None:
    with (
        serving(CONTENT, length=False) as server,
        pytest.raises(DownloadError, match="more than the 7 bytes"),
    ):
        fetch(plan(server.address, tmp_path, Seal(n_bytes=7)))
    assert not (tmp_path / "weights.bin").exists()


@pytest.mark.parametrize(
    ("settings", "message", "n_asked"),
    [
        ({"status": 404}, "answers 404 Not Found; has the file moved", 1),
        ({"status": 403}, "answers 403", 1),
        ({"status": 503}, "answers 503.*tried 2 times", 2),
        ({"content_type": "text/html; charset=utf-8"}, "a web page, not a file", 1),
    ],
)
def test_server_that_does_not_give_the_file(
    tmp_path: Path, settings: dict[str, Any], message: str, n_asked: int
) -> None:
    with serving(CONTENT, **settings) as server, pytest.raises(DownloadError, match=message):
        fetch(plan(server.address, tmp_path, attempts=2))
    assert len(server.asked) == n_asked
    assert left_in(tmp_path) == []


def test_nobody_there_says_so_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Bound and not listening: refused whoever looks for a port meanwhile.
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{nobody.getsockname()[1]}/weights.bin"
        monkeypatch.setattr(time, "sleep", lambda _: pytest.fail("it tried again"))
        with pytest.raises(DownloadError, match="Connection refused; is there a network"):
            fetch(plan_download(address, tmp_path / "weights.bin"))


def test_silence_counts_as_cut(tmp_path: Path) -> None:
    with serving(CONTENT, pause_s=5) as server, pytest.raises(DownloadError, match="tried 2"):
        fetch(
            plan_download(server.address, tmp_path / "w", pause_s=0.01, timeout_s=0.05, attempts=2)
        )


@pytest.mark.parametrize("address", ["file:///etc/passwd", "ftp://a/b", "calc", "http:///x"])
def test_only_the_web_is_asked(tmp_path: Path, address: str) -> None:
    with pytest.raises(DownloadError, match="expected http"):
        plan_download(address, tmp_path / "w")


def test_two_processes_do_not_write_one_file(tmp_path: Path) -> None:
    import fcntl

    with serving(CONTENT) as server:
        ready = plan(server.address, tmp_path)
        with ready.part.open("ab") as taken:
            fcntl.flock(taken, fcntl.LOCK_EX)
            with pytest.raises(DownloadError, match="another process"):
                fetch(ready)
    assert server.asked == []


def test_progress_ends_where_it_said(tmp_path: Path) -> None:
    seen: list[int] = []

    def watch(items: Any, *, total: int, label: str) -> Any:
        assert label == "fetching weights.bin"
        for item in items:
            seen.append(total)
            yield item

    with serving(CONTENT * 8) as server:
        fetch(plan(server.address, tmp_path), watch)
    assert seen == [3, 3, 3]  # 2.4 MB in steps of 2**20 bytes


def test_killed_process_is_carried_on(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from retraverse.weights.download import fetch, plan_download\n"
        "fetch(plan_download(sys.argv[1], Path(sys.argv[2])))\n"
    )
    with serving(CONTENT, pause_s=0.5) as server:
        command = [sys.executable, "-c", code, server.address, str(tmp_path / "weights.bin")]
        process = subprocess.Popen(command)
        part = tmp_path / "weights.bin.part"
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and not (part.exists() and part.stat().st_size):
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        came = part.stat().st_size
        assert 0 < came < len(CONTENT)
        assert not (tmp_path / "weights.bin").exists()
        server.pause_s = 0
        seal = fetch(plan(server.address, tmp_path))
    assert server.asked == [None, f"bytes={came}-"]
    assert seal.sha256 == SHA256
    assert left_in(tmp_path) == ["weights.bin"]
