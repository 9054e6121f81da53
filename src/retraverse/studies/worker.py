"""The program of one worker process: tasks in, outcomes out, until the pipe closes.

Started as ``python -m retraverse.studies.worker FILE_DESCRIPTOR`` by `workers.ProcessPool`.
"""

import importlib
import signal
import sys
from multiprocessing.connection import Connection

__all__ = ["main"]


def main() -> None:
    """Serve the process that started this one."""
    # Ctrl-C reaches the whole group; the one who started us decides what becomes of it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Connection(int(sys.argv[1])) as link:
        try:
            prepare(link.recv())
        except Exception as error:
            link.send(f"{type(error).__name__}: {error}")
            return
        link.send("ready")
        serve(link)


def prepare(modules: tuple[str, ...]) -> None:
    """Import what tasks need, and the user's own modules; one thread each."""
    import cv2

    from retraverse.studies import workers  # noqa: F401

    cv2.setNumThreads(1)
    for module in modules:
        importlib.import_module(module)


def serve(link: Connection) -> None:
    """Run task after task."""
    from retraverse.studies.workers import run_task

    while True:
        try:
            task = link.recv()
        except EOFError:
            return
        try:
            link.send(run_task(task))
        except BrokenPipeError:
            return


if __name__ == "__main__":
    main()
