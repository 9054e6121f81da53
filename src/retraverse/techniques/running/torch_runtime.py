"""Running a network under PyTorch: no gradients, and as many threads as asked for."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from retraverse.techniques.running.extras import import_extra
from retraverse.types import FloatArray

if TYPE_CHECKING:
    import torch

__all__ = ["TorchRunner", "torch_threads"]


class TorchRunner:
    """A module that takes and gives NumPy arrays.

    Parameters
    ----------
    network : torch.nn.Module
        In evaluation mode.
    threads : int >= 1
        Inside one run.
    """

    def __init__(self, network: "torch.nn.Module", threads: int) -> None:
        self._network = network
        self._threads = threads

    def __call__(self, pictures: FloatArray) -> FloatArray:
        """Return the network's output for float32 (N, C, H, W)."""
        import torch

        with torch_threads(self._threads), torch.inference_mode():
            output = self._network(torch.from_numpy(np.ascontiguousarray(pictures)))
            return np.asarray(output.numpy(), dtype=np.float32)


_lock = threading.Lock()
_inside = 0
_before = 1


@contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """Let PyTorch use so many threads inside, and afterwards as many as before.

    The number belongs to the process, and in part to each thread of Python: every one that
    enters sets it, and the last to leave sets it as it was before the first.
    """
    global _inside, _before
    torch = import_extra("torch", "learned")
    with _lock:
        found = torch.get_num_threads()
        if not _inside:
            _before = found
        _inside += 1
        torch.set_num_threads(threads)
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            torch.set_num_threads(found if _inside else _before)
