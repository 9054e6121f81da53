"""Downloads that can be cut at any instant and carry on, and files out of archives.

`plan_download` decides; `fetch` acts. What has come so far lies in
``FILE.part``; ``FILE`` itself is whole and verified or not there.

Two halves are joined only where they belong together: the server must still have the same version
(its ETag or date, kept in ``FILE.part.json``), or a checksum must be known that would tell. A
server that cannot continue (no ranges) is asked for everything again.
"""

import contextlib
import fcntl
import http.client
import json
import os
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

from retraverse._version import __version__
from retraverse.errors import InputError, RetraverseError
from retraverse.files import write_whole
from retraverse.types import Progress, no_progress
from retraverse.weights.checksum import LARGEST_BYTES, Seal, check_file
from retraverse.weights.download_plan import DownloadError, DownloadPlan, plan_download

__all__ = ["DownloadError", "DownloadPlan", "fetch", "plan_download"]

CHUNK_BYTES = 1 << 17
TICK_BYTES = 1 << 20
"""What one step of the progress stands for."""


class _CutOffError(Exception):
    """The connection ended before the file did: worth another try."""


@dataclass(frozen=True)
class _Start:
    """How the server answered: where its bytes begin, how many there are in all, which version."""

    offset: int
    total: int | None
    version: str | None


def fetch(plan: DownloadPlan, progress: Progress = no_progress) -> Seal:
    """Download, carrying on from what is there, and return the seal of the whole file.

    Raises
    ------
    DownloadError
        If the file cannot be had. What came of it stays for another time, unless its content
        is wrong.
    """
    plan.target.parent.mkdir(parents=True, exist_ok=True)
    with _plain_errors(plan), _only_one(plan) as part:
        _fetch_part(plan, part, progress)
        part.flush()
        os.fsync(part.fileno())
        try:
            seal = check_file(plan.part, plan.expected, plan.address)
        except InputError as error:
            _forget(plan)
            raise DownloadError(f"{error} (nothing was kept)") from error
        plan.part.replace(plan.target)
        plan.record.unlink(missing_ok=True)
    return seal


@contextlib.contextmanager
def _only_one(plan: DownloadPlan) -> Iterator[BinaryIO]:
    """Open the partial file for this process alone."""
    with plan.part.open("a+b") as part:
        try:
            fcntl.flock(part, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DownloadError(f"{plan.target.name}: another process is fetching it") from error
        try:
            yield part
        finally:
            if plan.part.exists() and not part.seek(0, os.SEEK_END):
                _forget(plan)


@contextlib.contextmanager
def _plain_errors(plan: DownloadPlan) -> Iterator[None]:
    """Turn what network and disk raise into one line."""
    try:
        yield
    except RetraverseError:
        raise
    except urllib.error.HTTPError as error:
        error.close()
        raise DownloadError(
            f"{plan.address}: the server answers {error.code} {error.reason}; has the file moved?"
        ) from error
    except urllib.error.URLError as error:
        raise DownloadError(f"{plan.address}: {_reason(error)}; is there a network?") from error
    except (http.client.HTTPException, ValueError) as error:
        raise DownloadError(f"{plan.address}: no sensible answer ({error})") from error
    except OSError as error:
        raise DownloadError(
            f"{plan.target}: cannot be written: {error.strerror or error}"
        ) from error


def _reason(error: urllib.error.URLError) -> str:
    return str(getattr(error.reason, "strerror", None) or error.reason)


def _fetch_part(plan: DownloadPlan, part: BinaryIO, progress: Progress) -> None:
    """Fill the partial file, asking again where the connection is cut."""
    failures = 0
    while True:
        before = part.seek(0, os.SEEK_END)
        try:
            _continue(plan, part, progress)
            return
        except (_CutOffError, urllib.error.URLError, ConnectionError, TimeoutError) as error:
            if not _may_pass(error):
                raise
            failures = 0 if part.seek(0, os.SEEK_END) > before else failures + 1
            if failures >= plan.attempts:
                raise _give_up(plan, error) from error
            time.sleep(plan.pause_s * 2**failures / 2)


def _may_pass(error: Exception) -> bool:
    """Tell whether another try makes sense: not if the name or the file is unknown."""
    if isinstance(error, urllib.error.HTTPError):
        return error.code >= http.HTTPStatus.INTERNAL_SERVER_ERROR
    if isinstance(error, urllib.error.URLError):
        return isinstance(error.reason, (TimeoutError, ConnectionResetError))
    return True


def _give_up(plan: DownloadPlan, error: Exception) -> DownloadError:
    what = str(error) or "silence"
    if isinstance(error, urllib.error.HTTPError):
        error.close()
        what = f"the server answers {error.code} {error.reason}"
    return DownloadError(
        f"{plan.address}: {what} (tried {plan.attempts} times; asking again carries on)"
    )


def _continue(plan: DownloadPlan, part: BinaryIO, progress: Progress) -> None:
    """Ask for what is missing and write it."""
    offset = _usable_bytes(plan, part)
    try:
        answer = urllib.request.urlopen(_request(plan, offset), timeout=plan.timeout_s)
    except urllib.error.HTTPError as error:
        if error.code != http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE or not offset:
            raise
        error.close()
        if _total_of(error.headers.get("Content-Range")) == offset:
            return  # All of it had come before.
        part.truncate(0)
        raise _CutOffError("what had come was no part of the file") from error
    with answer:
        start = _read_head(plan, answer, offset)
        part.truncate(start.offset)
        part.seek(0, os.SEEK_END)
        _write_record(plan, start)
        _copy(plan, answer, part, start, progress)


def _usable_bytes(plan: DownloadPlan, part: BinaryIO) -> int:
    """Return how many bytes of the partial file may be kept; the rest is cut off."""
    size = part.seek(0, os.SEEK_END)
    record = _read_record(plan)
    same_place = record.get("address") == plan.address
    provable = bool(record.get("version")) or plan.expected.has_checksum
    if size and not (same_place and provable):
        part.truncate(0)
        return 0
    return size


def _request(plan: DownloadPlan, offset: int) -> urllib.request.Request:
    headers = {"User-Agent": f"retraverse/{__version__}", "Accept-Encoding": "identity"}
    if offset:
        headers["Range"] = f"bytes={offset}-"
        if version := _read_record(plan).get("version"):
            headers["If-Range"] = version
    return urllib.request.Request(plan.address, headers=headers)


def _read_head(plan: DownloadPlan, answer: Any, offset: int) -> _Start:
    """Return what the server's answer promises.

    Raises
    ------
    DownloadError
        If it is a web page, or of another size than expected.
    """
    kind = answer.headers.get_content_type()
    if kind == "text/html":
        raise DownloadError(
            f"{plan.address}: the server gives a web page, not a file (a question before the "
            "download, or a notice); fetch it with a browser"
        )
    version = answer.headers.get("ETag") or answer.headers.get("Last-Modified")
    if version and version.startswith("W/"):
        version = None  # A weak ETag does not promise the same bytes.
    if answer.status == http.HTTPStatus.PARTIAL_CONTENT:
        begin, total = _range_of(answer.headers.get("Content-Range"))
        if begin != offset:
            raise DownloadError(f"{plan.address}: asked for byte {offset}, got {begin}")
        start = _Start(offset, total, version)
    else:
        length = answer.headers.get("Content-Length")
        start = _Start(0, int(length) if length else None, version)
    _check_size(plan, start.total)
    return start


def _check_size(plan: DownloadPlan, total: int | None) -> None:
    expected = plan.expected.n_bytes
    if total is not None and expected is not None and total != expected:
        raise DownloadError(
            f"{plan.address}: the server has {total} bytes, expected {expected}; another file"
        )
    if total is not None and total > LARGEST_BYTES:
        raise DownloadError(f"{plan.address}: {total} bytes are too many for weights")


def _copy(
    plan: DownloadPlan, answer: Any, part: BinaryIO, start: _Start, progress: Progress
) -> None:
    """Write what comes until the file is whole.

    Raises
    ------
    _CutOffError
        If it ends too early; what came is kept.
    """
    total = start.total if start.total is not None else plan.expected.n_bytes
    limit = total if total is not None else LARGEST_BYTES
    ticks = max(1, -(-((total or 0) - start.offset) // TICK_BYTES))
    body = _write_body(plan, answer, part, start.offset, limit)
    for _ in progress(body, total=ticks, label=f"fetching {plan.target.name}"):
        pass
    done = part.seek(0, os.SEEK_END)
    if total is not None and done < total:
        raise _CutOffError(f"the connection was cut after {done} of {total} bytes")


def _write_body(
    plan: DownloadPlan, answer: Any, part: BinaryIO, offset: int, limit: int
) -> Iterator[int]:
    """Write the body as it comes; every `TICK_BYTES`, and at its end, yield how much there is."""
    done, told = offset, offset
    for chunk in _chunks(answer):
        done += len(chunk)
        if done > limit:
            raise DownloadError(f"{plan.address}: sends more than the {limit} bytes expected")
        part.write(chunk)
        part.flush()
        if done - told >= TICK_BYTES:
            told = done
            yield done
    if done > told:
        yield done


def _chunks(answer: Any) -> Iterator[bytes]:
    """Yield the body; a connection that breaks ends it.

    Raises
    ------
    _CutOffError
        If it broke audibly.
    """
    while True:
        try:
            # Not `read`: what has come of a slow chunk would be lost with the connection.
            chunk = answer.read1(CHUNK_BYTES)
        except (http.client.IncompleteRead, ConnectionError, TimeoutError) as error:
            raise _CutOffError(f"the connection was cut ({error or 'silence'})") from error
        if not chunk:
            return
        yield chunk


def _range_of(header: str | None) -> tuple[int, int | None]:
    """Return first byte and total of ``bytes 5-9/10``."""
    unit, _, rest = (header or "").partition(" ")
    span, _, total = rest.partition("/")
    begin = span.partition("-")[0]
    if unit != "bytes" or not begin.isdigit():
        raise DownloadError(f"the server's Content-Range is {header!r}, expected bytes A-B/N")
    return int(begin), int(total) if total.isdigit() else None


def _total_of(header: str | None) -> int | None:
    total = (header or "").rpartition("/")[2]
    return int(total) if total.isdigit() else None


def _write_record(plan: DownloadPlan, start: _Start) -> None:
    record = {"address": plan.address, "version": start.version}
    write_whole(plan.record, json.dumps(record).encode())


def _read_record(plan: DownloadPlan) -> dict[str, str]:
    try:
        record = json.loads(plan.record.read_bytes())
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _forget(plan: DownloadPlan) -> None:
    plan.part.unlink(missing_ok=True)
    plan.record.unlink(missing_ok=True)
