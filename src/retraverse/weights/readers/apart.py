"""Reading a file in a process of its own: a parser that crashes or never ends takes nothing along.

For formats whose parser is other people's C: libhdf5 on a damaged file may run for ever, and no
Python code can stop it. The process writes what it read as safetensors, and is ended after
`LONGEST_S`.
"""

import os
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from retraverse.errors import InputError, MissingExtraError
from retraverse.weights.readers import safetensors_file
from retraverse.weights.readers.guard import reading
from retraverse.weights.weight_file import WeightFile

__all__ = ["LONGEST_S", "read_apart"]

LONGEST_S = 300.0
"""A gigabyte takes some seconds."""
_REFUSED, _EXTRA_MISSING = 3, 4
_FORMAT = "retraverse format"
_START = "import sys; from retraverse.weights.readers.apart import main; main(*sys.argv[1:])"


def read_apart(module: str, path: Path, what: str) -> WeightFile:
    """Return what ``module.read_here(path)`` returns, called in another process.

    Parameters
    ----------
    module : str
        A reader of this package.
    path : Path
    what : str
        What it is read as, with its article.

    Raises
    ------
    InputError
        If the file is damaged, or its parser crashes or takes longer than `LONGEST_S`.
    MissingExtraError
        If its parser is not installed.
    """
    with reading(path, what), tempfile.TemporaryDirectory(prefix="retraverse-") as folder:
        result = Path(folder) / "read.safetensors"
        _run([sys.executable, "-c", _START, module, os.fspath(path), os.fspath(result)])
        weights = safetensors_file.read(result)
    texts = dict(weights.metadata)
    return WeightFile(weights.tensors, texts, texts.pop(_FORMAT))


def _run(command: list[str]) -> None:
    """Run the process, and raise what it complains of."""
    # Plugins of HDF5 are code that a file may ask for.
    environment = {**os.environ, "HDF5_PLUGIN_PRELOAD": "::", "PYTHONPATH": _search_path()}
    try:
        done = subprocess.run(
            command, env=environment, stdin=subprocess.DEVNULL, capture_output=True,
            timeout=LONGEST_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"its parser had not ended after {LONGEST_S:g} s") from error
    said = done.stdout.decode("utf-8", "replace").strip()
    if done.returncode == _REFUSED:
        raise InputError(said)
    if done.returncode == _EXTRA_MISSING:
        raise MissingExtraError(said)
    if done.returncode:
        raise ValueError(f"its parser crashed (exit code {done.returncode})")


def _search_path() -> str:
    return os.pathsep.join(str(Path(entry).resolve()) for entry in sys.path)


def main(module: str, path: str, result: str) -> None:
    """Read in this process, write to `result`, and end: with a line and a code if refused."""
    from safetensors.numpy import save_file

    try:
        weights: WeightFile = import_module(module).read_here(Path(path))
        with reading(Path(path), weights.format):
            about = {**weights.metadata, _FORMAT: weights.format}
            save_file(dict(weights.tensors), result, about)
    except (InputError, MissingExtraError) as error:
        sys.stdout.buffer.write(str(error).encode())
        sys.exit(_REFUSED if isinstance(error, InputError) else _EXTRA_MISSING)
