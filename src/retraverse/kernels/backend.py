"""Which kernels run: the compiled ones or their NumPy twins, and on how many threads.

Contents: `backend`, `instruction_sets`, `default_threads`; `native` for the other modules of this
package. Two environment variables decide, and are read at every call:

- ``RETRAVERSE_KERNELS``: ``auto`` (default: compiled where there, else NumPy with one warning),
  ``native`` (an error where not compiled), ``numpy`` (always the twins).
- ``RETRAVERSE_THREADS``: how many threads a kernel uses by default, at least 1.
"""

import functools
import importlib
import logging
import os
import threading
from types import ModuleType
from typing import Literal

from retraverse.errors import ConfigError, MissingExtraError

__all__ = ["backend", "default_threads", "instruction_sets", "native"]

_log = logging.getLogger(__name__)
_warning = threading.Lock()
_CHOICES = ("auto", "native", "numpy")


def backend() -> Literal["native", "numpy"]:
    """Return which kernels run now: ``"native"`` (compiled) or ``"numpy"`` (their twins).

    Raises
    ------
    ConfigError
        RETRAVERSE_KERNELS is none of auto, native, numpy.
    MissingExtraError
        RETRAVERSE_KERNELS is native and the compiled kernels are missing.
    """
    return "numpy" if native() is None else "native"


def instruction_sets() -> tuple[str, ...]:
    """Return the instruction sets the compiled kernels can use here, newest first.

    Of ``amx``, ``vnni``, ``avx512``, ``avx2`` (x86-64), ``neondot``, ``neon`` (64-bit Arm), and
    always ``plain`` at the end; empty where `backend` is ``"numpy"``. A kernel without a version
    of its own for one of them uses the next in the list.
    """
    module = native()
    return () if module is None else tuple(module.instruction_sets())


def default_threads() -> int:
    """Return how many threads kernels use: RETRAVERSE_THREADS, else the cores open to this process.

    Raises
    ------
    ConfigError
        RETRAVERSE_THREADS is not a whole number of at least 1.
    """
    value = os.environ.get("RETRAVERSE_THREADS", "")
    if not value:
        return _available_cores()
    if not value.isdecimal() or int(value) < 1:
        raise ConfigError(f"RETRAVERSE_THREADS is {value!r}, expected a whole number from 1")
    return int(value)


def native() -> ModuleType | None:
    """Return the compiled module, or None where the NumPy twins are to run; raises as `backend`."""
    choice = os.environ.get("RETRAVERSE_KERNELS", "auto")
    if choice not in _CHOICES:
        expected = ", ".join(_CHOICES)
        raise ConfigError(f"RETRAVERSE_KERNELS is {choice!r}, expected one of {expected}")
    if choice == "numpy":
        return None
    module, reason = _compiled()
    if module is None and choice == "native":
        raise MissingExtraError(
            f"RETRAVERSE_KERNELS is native but the compiled kernels cannot be loaded ({reason}); "
            "install retraverse again where a C++ compiler is, or unset RETRAVERSE_KERNELS"
        )
    if module is None:
        with _warning:  # A cache alone lets several threads be the first.
            _warn_once(reason)
    return module


def _available_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@functools.cache
def _compiled() -> tuple[ModuleType | None, str]:
    """Return the compiled module and "", or None and why it cannot be loaded."""
    try:
        return importlib.import_module("retraverse.kernels._native"), ""
    except ImportError as error:
        return None, str(error)


@functools.cache
def _warn_once(reason: str) -> None:
    _log.warning("compiled kernels are missing (%s): NumPy runs instead, many times slower", reason)
