"""The small server: this machine's pages to this machine, and nothing else."""

import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.unit.reports.study_report.made_up import make_run, write_study

from retraverse.errors import InputError
from retraverse.reports.study_report.serve import StudyServer


@pytest.fixture(name="server")
def _server(tmp_path: Path) -> Iterator[StudyServer]:
    study, folder = write_study(tmp_path / "study", [make_run()]), tmp_path / "pages"
    (tmp_path / "secret.html").write_text("secret")
    folder.mkdir()
    (folder / ".hidden").write_text("secret")
    (folder / "runs").mkdir()
    (folder / "link.html").symlink_to(tmp_path / "secret.html")

    def write() -> None:
        n_files = len(list((study / "records").glob("*.parquet")))
        (folder / "index.html").write_text(f"{n_files} files")

    server = StudyServer(study, folder, write)
    thread = threading.Thread(target=server.serve)
    thread.start()
    yield server
    server.close()
    thread.join(60)
    assert not thread.is_alive()


def ask(server: StudyServer, path: str, method: str = "GET", host: str = "") -> tuple[int, bytes]:
    port = int(server.address.rsplit(":", 1)[1].strip("/"))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{port}")
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def test_the_first_page_is_served_to_this_machine(server: StudyServer) -> None:
    assert server.address.startswith("http://127.0.0.1:")
    assert ask(server, "/") == (200, b"1 files")
    assert ask(server, "/index.html") == (200, b"1 files")


def test_new_records_are_news_and_a_reload_shows_them(server: StudyServer) -> None:
    assert json.loads(ask(server, "/status.json")[1]) == {"news": False} or ask(server, "/")
    write_study(server.study, [make_run("campus_loop")], part="later")
    assert json.loads(ask(server, "/status.json")[1]) == {"news": True}
    assert ask(server, "/")[1] == b"2 files"
    assert json.loads(ask(server, "/status.json")[1]) == {"news": False}


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.html",
        "/%2e%2e/secret.html",
        "/..%2fsecret.html",
        "//../../secret.html",
        "/link.html",
        "/.hidden",
        "/runs/",
        "/nothing.html",
        "/../study/records/part-0.parquet",
    ],
)
def test_nothing_outside_the_report_is_served(server: StudyServer, path: str) -> None:
    status, body = ask(server, path)
    assert status == 404
    assert b"secret" not in body


def test_other_methods_and_names_are_refused(server: StudyServer) -> None:
    assert ask(server, "/", "POST")[0] == 501
    assert ask(server, "/", host="rebound.example:80")[0] == 421
    assert ask(server, "/", host="localhost:1")[0] == 200


def test_a_taken_port_is_said(server: StudyServer, tmp_path: Path) -> None:
    port = int(server.address.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(InputError, match="cannot listen"):
        StudyServer(server.study, tmp_path, lambda: None, port=port)
