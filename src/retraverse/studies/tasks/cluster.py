"""A study's tasks on a Dask cluster: other processes, other machines (the extra ``cluster``).

The cluster's workers read the pictures under the same paths as this process does. Those that see
the study's cache too read descriptions and matrices there; to others they are sent along. Only
this process writes. Records are those of local workers, hash for hash.
"""

import importlib
import itertools
import os
import secrets
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from retraverse._version import __version__
from retraverse.errors import ConfigError, InputError, MissingExtraError
from retraverse.studies.tasks.match_task import MatchTask, in_hand, is_readable
from retraverse.studies.tasks.workers import (
    MOST_ATTEMPTS,
    ONE_THREAD,
    Done,
    Outcome,
    Task,
    run_task,
)

__all__ = ["DaskPool", "UnseenFilesError", "check_address"]

CONNECT_S = 20
WORKERS_S = 60


class UnseenFilesError(Exception):
    """A worker of the cluster cannot read the study's cache, though others can."""


def check_address(address: str) -> int | None:
    """Return how many local workers an address asks for, None for a scheduler's address.

    Raises
    ------
    ConfigError
        If it is neither ``local:N`` nor ``tcp://…`` nor ``tls://…``.
    """
    kind, _, count = address.partition(":")
    if kind == "local" and count.isascii() and count.isdigit() and 1 <= int(count) <= 1024:
        return int(count)
    if address.startswith(("tcp://", "tls://")):
        return None
    raise ConfigError(
        f"cluster: got {address!r}, expected tcp://HOST:PORT, tls://HOST:PORT or local:WORKERS"
    )


class DaskPool:
    """The workers of a Dask cluster; see `workers.Pool`.

    Parameters
    ----------
    address : str
        ``tcp://…`` or ``tls://…`` of a scheduler, or ``local:4`` for a cluster of its own.
    modules : sequence of str
        Python modules every worker imports first.
    cache : Path, optional
        The study's cache. Workers that can read it are told paths; to others all is sent.

    Raises
    ------
    MissingExtraError
        If Dask is not installed.
    InputError
        If nothing answers at the address, or no worker comes.
    """

    def __init__(
        self, address: str, modules: Sequence[str] = (), cache: Path | None = None
    ) -> None:
        n_local = check_address(address)
        distributed = _distributed()
        self._modules = tuple(modules)
        self._own = None if n_local is None else _local_cluster(distributed, n_local)
        try:
            self._client = distributed.Client(self._own or address, timeout=CONNECT_S)
        except (OSError, TimeoutError) as error:
            raise InputError(
                f"cluster {address}: nothing answers ({error}); is the scheduler running, and its "
                "certificate the one of your configuration?"
            ) from error
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError as error:
            self.close()
            raise InputError(
                f"cluster {address}: no worker joined within {WORKERS_S} s; start one with "
                f"dask worker {address}"
            ) from error
        self._coming = distributed.as_completed()
        self._tasks: dict[str, tuple[int, Task, int]] = {}
        self._name = secrets.token_hex(4)
        self._serial = itertools.count()
        self.sees_files = cache is not None and self._workers_see(cache)

    @property
    def capacity(self) -> int:
        """See `Pool.capacity`: workers may come and go."""
        return 2 * max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def submit(self, number: int, task: Task) -> None:
        """See `Pool.submit`."""
        self._send(number, task, 1)

    def next_done(self) -> Done:
        """See `Pool.next_done`."""
        while True:
            future = next(self._coming)
            number, task, attempt = self._tasks.pop(future.key)
            if future.status == "finished":
                outcome: Outcome = future.result()
                return Done(number, outcome)
            error = future.exception() if future.status == "error" else None
            if type(error).__name__ == "UnseenFilesError" and isinstance(task, MatchTask):
                # It joined after the others were asked.
                self.sees_files = False
                self._send(number, in_hand(task), attempt)
                continue
            if error is not None and type(error).__name__ != "KilledWorker":
                # Tasks do not raise: this is the cluster's, not the study's.
                raise InputError(f"cluster: a task could not be run: {error}") from error
            if attempt >= MOST_ATTEMPTS or error is not None:
                return Done(number, None)
            self._send(number, task, attempt + 1)

    def close(self) -> None:
        """See `Pool.close`; a scheduler that was there before stays."""
        self._client.close()
        if self._own is not None:
            self._own.close()

    def _workers_see(self, folder: Path) -> bool:
        """Return whether all workers can read what this process writes into a folder.

        From those on this machine outcomes then come without a detour by the scheduler.
        """
        text = secrets.token_hex(16)
        note = folder / f".{socket.gethostname()}-{os.getpid()}-{text}.tmp"
        try:
            note.parent.mkdir(parents=True, exist_ok=True)
            note.write_text(text)
            hosts = set(self._client.run(_host_that_reads, str(note), text).values())
        except Exception:  # A worker of another version, one just lost: then all is sent along.
            return False
        finally:
            note.unlink(missing_ok=True)
        self._client.direct_to_workers = hosts == {socket.gethostname()} or None
        return bool(hosts) and "" not in hosts

    def _send(self, number: int, task: Task, attempt: int) -> None:
        # Dask foresees how long tasks take by the words at the front of their keys.
        kind = "match" if isinstance(task, MatchTask) else "describe"
        # A key of its own for every sending: by an old one Dask answers what it answered before.
        key = f"retraverse-{kind}-{self._name}-{next(self._serial)}"
        self._tasks[key] = number, task, attempt
        future = self._client.submit(
            _run_remote, task, self._modules, __version__, key=key, pure=False
        )
        self._coming.add(future)


def _run_remote(task: Task, modules: tuple[str, ...], version: str) -> Outcome:
    """Run a task on a worker of the cluster, on one thread."""
    if version != __version__:
        raise InputError(
            f"this worker has retraverse {__version__}, the study runs with {version}; "
            "install the same version everywhere"
        )
    if isinstance(task, MatchTask) and not is_readable(task):
        raise UnseenFilesError(f"{socket.gethostname()} does not see the study's cache")
    import cv2

    cv2.setNumThreads(1)
    # For workers that were started without it; what counts threads at its import is told too late.
    os.environ.setdefault("RETRAVERSE_THREADS", "1")
    for module in modules:
        importlib.import_module(module)
    return run_task(task)


def _host_that_reads(path: str, text: str) -> str:
    """Return the name of this machine if it reads that text in that file, else nothing."""
    try:
        return socket.gethostname() if Path(path).read_text() == text else ""
    except OSError:
        return ""


def _distributed() -> Any:
    try:
        import dask
        import distributed
    except ImportError as error:
        raise MissingExtraError(
            "Dask is not installed, and --cluster needs it; "
            "install it with: pip install 'retraverse[cluster]'"
        ) from error
    # A task carries its descriptions with it; that is meant.
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"})
    return distributed


def _local_cluster(distributed: Any, n_workers: int) -> Any:
    """Return a cluster of this machine that nobody else can reach."""
    return distributed.LocalCluster(
        n_workers=n_workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=40,
        env={**ONE_THREAD, "PYTHONPATH": ":".join(path for path in sys.path if path)},
    )
