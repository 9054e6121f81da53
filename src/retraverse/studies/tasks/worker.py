"""The program of one worker process: tasks in, outcomes out, until the pipe closes.

Started as ``python -m retraverse.studies.tasks.worker FILE_DESCRIPTOR PROCESS`` by
`workers.ProcessPool`, with its own process number. A worker ends within `WATCH_S` of the process
it serves, however that ends and whatever it is at: nobody would take the outcome.
"""

import importlib
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection

__all__ = ["WATCH_S", "main"]

WATCH_S = 0.25


def main() -> None:
    """Serve the process that started this one."""
    # Ctrl-C reaches the whole group; the one who started us decides what becomes of it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with, args=(int(sys.argv[2]),), daemon=True).start()
    with Connection(int(sys.argv[1])) as link:
        try:
            prepare(link.recv())
        except Exception as error:
            link.send(f"{type(error).__name__}: {error}")
            return
        link.send("ready")
        serve(link)


def end_with(process: int) -> None:
    """Wait until another process is the parent of this one, then end at once."""
    while os.getppid() == process:
        time.sleep(WATCH_S)
    # Not sys.exit: the task in hand must not go on, nor anything be tidied up.
    os._exit(1)


def prepare(modules: tuple[str, ...]) -> None:
    """Import what tasks need, and the user's own modules; one thread each."""
    import cv2

    from retraverse.studies.tasks import workers  # noqa: F401

    cv2.setNumThreads(1)
    for module in modules:
        importlib.import_module(module)


def serve(link: Connection) -> None:
    """Run task after task."""
    from retraverse.studies.tasks.workers import run_task

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
