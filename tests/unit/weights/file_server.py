"""A web server on this machine that misbehaves as told: for tests of downloads."""

import hashlib
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass
class Served:
    """One server: what it gives, and how badly."""

    content: bytes
    ranges: bool = True
    """Whether it can continue in the middle."""
    version: str | None = "auto"
    """Its ETag; ``auto`` = the content's own."""
    length: bool = True
    """Whether it says how long the file is."""
    cut_after: int | None = None
    """Bytes after which each of the first `cuts` answers breaks off."""
    cuts: int = 0
    status: int = 200
    content_type: str = "application/octet-stream"
    pause_s: float = 0.0
    """Before each 16 kB."""
    asked: list[str | None] = field(default_factory=list)
    """The Range header of every request."""
    address: str = ""

    @property
    def etag(self) -> str | None:
        if self.version != "auto":
            return self.version
        return f'"{hashlib.sha256(self.content).hexdigest()[:16]}"'


@contextmanager
def serving(content: bytes, **settings: Any) -> Iterator[Served]:
    served = Served(content, **settings)
    server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(served))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    served.address = f"http://127.0.0.1:{server.server_address[1]}/weights.bin"
    try:
        yield served
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _handler(served: Served) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.0"

        def do_GET(self) -> None:
            wanted = self.headers.get("Range")
            served.asked.append(wanted)
            if served.status != 200:
                self.send_error(served.status)
                return
            if self.headers.get("If-Range") not in (None, served.etag):
                wanted = None
            begin = int(wanted.removeprefix("bytes=").rstrip("-")) if wanted else 0
            if not served.ranges:
                begin = 0
            self._head(begin)
            self._body(served.content[begin:])

        def _head(self, begin: int) -> None:
            total = len(served.content)
            if begin and begin >= total:
                self.send_response(416)
                self.send_header("Content-Range", f"bytes */{total}")
                self.end_headers()
                return
            self.send_response(206 if begin else 200)
            if begin:
                self.send_header("Content-Range", f"bytes {begin}-{total - 1}/{total}")
            if served.length:
                self.send_header("Content-Length", str(total - begin))
            if served.etag:
                self.send_header("ETag", served.etag)
            self.send_header("Content-Type", served.content_type)
            self.end_headers()

        def _body(self, body: bytes) -> None:
            if served.cut_after is not None and served.cuts > 0:
                served.cuts -= 1
                body = body[: served.cut_after]
            for start in range(0, len(body), 1 << 14):
                time.sleep(served.pause_s)
                try:
                    self.wfile.write(body[start : start + (1 << 14)])
                except OSError:
                    return

        def log_message(self, format: str, *args: Any) -> None:
            pass

    return Handler
