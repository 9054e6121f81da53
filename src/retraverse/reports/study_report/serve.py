"""The pages of a study over HTTP on this machine, written anew as its records grow.

Only files of the report's folder are answered with, only to GET and HEAD, and by default only to
this machine. The standard library's server is meant for exactly this and no more.
"""

import io
import json
import os
import threading
from collections.abc import Callable
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from retraverse.errors import InputError, RetraverseError
from retraverse.studies.keeping.light_records import study_folders
from retraverse.studies.keeping.records import record_files

__all__ = ["StudyServer"]

STATUS = "/status.json"


class StudyServer:
    """Serves a study's report.

    Parameters
    ----------
    study : Path
        The study's folder.
    folder : Path
        Where the pages are written to and served from.
    write : callable
        Writes the pages of the study into the folder, anew at every call.
    host : str
        Address to listen on; the default is reached from this machine alone.
    port : int
        0 = any that is free.

    Raises
    ------
    InputError
        If the address cannot be listened on.
    """

    def __init__(
        self,
        study: Path,
        folder: Path,
        write: Callable[[], object],
        *,
        host: str = "127.0.0.1",
        port: int = 0,
    ) -> None:
        self.study, self.folder = study, folder
        self.host = host
        self._write = write
        self._lock = threading.Lock()
        self._shown: tuple[int, int] | None = None
        try:
            self._server = _Server((host, port), partial(_Handler, study_server=self))
        except OSError as error:
            raise InputError(
                f"cannot listen on {host}:{port}: {error.strerror}; is another program there? "
                "port 0 takes any that is free"
            ) from error

    @property
    def address(self) -> str:
        """Where a browser finds the first page."""
        host, port = self._server.server_address[:2]
        return f"http://{host!s}:{port}/"

    def serve(self) -> None:
        """Answer until `close` is called from another thread, or Ctrl-C."""
        self.refresh()
        try:
            self._server.serve_forever(poll_interval=0.2)
        finally:
            self._server.server_close()

    def close(self) -> None:
        """Stop `serve`."""
        self._server.shutdown()

    def refresh(self) -> None:
        """Write the pages if the study has other records than they show.

        What is damaged at this moment, in a study that runs, is shown at the next call.
        """
        with self._lock:
            now = _state(self.study)
            if now == self._shown:
                return
            try:
                self._write()
            except RetraverseError:
                if self._shown is None:
                    raise
                return
            self._shown = now

    def status(self) -> dict[str, bool]:
        """Return whether the study has records that the pages do not show yet."""
        return {"news": _state(self.study) != self._shown}


def _state(study: Path) -> tuple[int, int]:
    """Return how many record files there are, and a number that changes when one does."""
    stamps = []
    for path in (p for one in study_folders(study) for p in record_files(one / "records")):
        try:
            status = path.stat()
        except FileNotFoundError:  # superseded at this moment
            continue
        stamps.append((path.name, status.st_size, status.st_mtime_ns))
    return len(stamps), hash(tuple(stamps))


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    allow_reuse_address = os.name == "posix"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that went away."""


class _Handler(SimpleHTTPRequestHandler):
    server_version = "retraverse"
    sys_version = ""

    def __init__(self, *args: Any, study_server: StudyServer, **others: Any) -> None:
        self.study_server = study_server
        super().__init__(*args, directory=str(study_server.folder), **others)

    def send_head(self) -> Any:
        """Answer with a page's head; pages are brought up to date before."""
        if not self._is_for_us():
            self.send_error(421, "this server answers to its own address alone")
            return None
        path = unquote(urlsplit(self.path).path)
        if path == STATUS:
            return self._send_status()
        if path == "/" or path.endswith(".html"):
            self.study_server.refresh()
        if not self._is_inside(path):
            self.send_error(404, "no such page")
            return None
        return super().send_head()

    def _is_for_us(self) -> bool:
        """Refuse pages of other sites that reach this machine under a name of their own."""
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        own = self.study_server.host
        return host in ("localhost", "127.0.0.1", "[::1]", own) or own in ("0.0.0.0", "::")

    def _is_inside(self, path: str) -> bool:
        """Say whether a path is a file of the report: no folder lists, no hidden files."""
        parts = [part for part in path.split("/") if part]
        if any(part.startswith(".") for part in parts):
            return False
        root = self.study_server.folder.resolve()
        target = Path(self.translate_path(path)).resolve()
        if path == "/":
            return True
        return target.is_relative_to(root) and target.is_file()

    def _send_status(self) -> Any:
        body = json.dumps(self.study_server.status()).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        return io.BytesIO(body)

    def end_headers(self) -> None:
        """Add what keeps pages fresh and files what they are."""
        self.send_header("Cache-Control", "no-cache")
        self.send_header("X-Content-Type-Options", "nosniff")
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing of every request."""
