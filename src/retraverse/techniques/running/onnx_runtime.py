"""ONNX: a network written as a graph, run by ONNX Runtime, and made small in 8-bit integers.

The graph is the network alone, pictures (N, C, H, W) in, its output out: preparation and pooling
stay outside, so that every runtime shares them. Graphs are kept in the weights folder under a name
made of all that they depend on.
"""

import hashlib
import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.errors import InputError, RetraverseError
from retraverse.files import check_writable_place, write_whole
from retraverse.techniques.parameters import uncompared_parameters
from retraverse.techniques.running.batching import Runner
from retraverse.techniques.running.extras import import_extra
from retraverse.techniques.running.learned import ONNX_SUFFIX, LearnedTechnique
from retraverse.types import FloatArray

__all__ = [
    "INPUT_NAME",
    "OnnxRunner",
    "export_onnx",
    "graph_bytes",
    "onnx_runner",
    "quiet_exporter",
]

_EXPORT_VERSION = 1
"""Raised whenever graphs are written otherwise."""
INPUT_NAME, OUTPUT_NAME = "pictures", "outputs"


class OnnxRunner:
    """A graph with one input and at least one output, of which the first is taken.

    Parameters
    ----------
    graph : Path or bytes
        The ``.onnx`` file, or its content.
    threads : int >= 1
        Inside one run.

    Raises
    ------
    InputError
        If it is no graph that ONNX Runtime can run.
    MissingExtraError
        If ONNX Runtime is not installed.
    """

    def __init__(self, graph: Path | bytes, threads: int) -> None:
        runtime = import_extra("onnxruntime", "learned")
        options = runtime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        content = graph if isinstance(graph, bytes) else str(graph)
        try:
            self._session = runtime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # ONNX Runtime raises kinds of its own, all of them Exceptions
            raise InputError(f"{_named(graph)}: ONNX Runtime refuses it: {_line(error)}") from error
        self._name = self._session.get_inputs()[0].name
        self._graph = _named(graph)

    def __call__(self, pictures: FloatArray) -> FloatArray:
        """Return the first output for float32 (N, C, H, W).

        Raises
        ------
        InputError
            If the graph takes another shape.
        """
        try:
            outputs = self._session.run(None, {self._name: pictures})
        except Exception as error:
            raise InputError(
                f"{self._graph}: got pictures of shape {pictures.shape}, expected what the graph "
                f"takes, {self._session.get_inputs()[0].shape}: {_line(error)}"
            ) from error
        return np.asarray(outputs[0], dtype=np.float32)


def onnx_runner(technique: LearnedTechnique) -> Runner:
    """Return ONNX Runtime with a technique's network, exported once and kept.

    Where the weights are an ``.onnx`` file themselves, that graph is run as it is.

    Raises
    ------
    DataMissingError
        If the weights are not there.
    MissingExtraError
        If ONNX Runtime is not installed, or PyTorch is not and the graph was never exported.
    """
    import_extra("onnxruntime", "learned")
    weights = technique.weights_path()
    if weights.suffix == ONNX_SUFFIX:
        return OnnxRunner(weights, technique.parameters.threads)
    return _graph(technique)[1]


def graph_bytes(technique: LearnedTechnique) -> bytes:
    """Return the graph of a technique's network: the kept one, or exported and then kept."""
    return _graph(technique)[0]


def _graph(technique: LearnedTechnique) -> tuple[bytes, OnnxRunner]:
    threads = technique.parameters.threads
    kept = graph_path(technique)
    if kept.is_file():
        content = kept.read_bytes()
        try:
            return content, OnnxRunner(content, threads)
        except InputError:
            pass  # Damaged: it is made again.
    content = _exported(technique)
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_whole(kept, content)
    except OSError:
        pass  # A folder that cannot be written to costs another export, nothing else.
    return content, OnnxRunner(content, threads)


def graph_path(technique: LearnedTechnique) -> Path:
    """Return where the weights folder keeps the graph of a technique's network."""
    from retraverse.weights.store import weights_folder

    free = uncompared_parameters(technique.parameters)
    parameters = asdict(technique.parameters)
    identity = {
        "export": _EXPORT_VERSION,
        "technique": [technique.name, technique.version],
        "parameters": {key: value for key, value in parameters.items() if key not in free},
        "input": technique.input_shape(),
        "weights": technique.fingerprint(),
    }
    digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
    return weights_folder() / "onnx" / f"{technique.name}-{digest[:24]}{ONNX_SUFFIX}"


def export_onnx(technique: LearnedTechnique, path: Path) -> Path:
    """Write a technique's network as an ONNX graph, and return its path.

    The graph takes float32 ``pictures`` (N, C, H, W), any N, as `LearnedTechnique.prepare` gives
    them, and gives ``outputs``, which `LearnedTechnique.pool` makes vectors of.
    ``technique(name, weights=path)`` runs it.

    Raises
    ------
    InputError
        If the network cannot be exported, or nothing can be written at `path`.
    DataMissingError
        If the weights, or the folder of `path`, are not there.
    MissingExtraError
        If PyTorch, onnx or onnxscript is not installed.
    """
    if path.suffix != ONNX_SUFFIX:
        raise InputError(f"cannot write {path}: expected a name that ends with {ONNX_SUFFIX}")
    check_writable_place(path)
    write_whole(path, graph_bytes(technique))
    return path


def _exported(technique: LearnedTechnique) -> bytes:
    """Return the graph's bytes."""
    torch = import_extra("torch", "learned")
    for module in ("onnx", "onnxscript"):
        import_extra(module, "learned")
    network = technique.network()
    # Two pictures: an axis of length 1 would be taken for one that is always so.
    example = torch.zeros((2, *technique.input_shape()))
    with quiet_exporter():
        try:
            program = torch.onnx.export(
                network,
                (example,),
                dynamo=True,
                dynamic_shapes=({0: torch.export.Dim("batch")},),
                input_names=[INPUT_NAME],
                output_names=[OUTPUT_NAME],
                verbose=False,
            )
        except RuntimeError as error:
            raise RetraverseError(
                f"{technique.name}: cannot be exported: {_line(error)}"
            ) from error
    model: Any = program.model_proto
    model.doc_string = f"{technique.name} version {technique.version}, by retraverse"
    return bytes(model.SerializeToString())


@contextmanager
def quiet_exporter() -> Iterator[None]:
    """Silence what the exporter says of its own insides and of modules it does not need."""
    import logging

    log = logging.getLogger("torch.onnx")
    before = log.level
    log.setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        finally:
            log.setLevel(before)


def _named(graph: Path | bytes) -> str:
    return "the exported graph" if isinstance(graph, bytes) else f"graph {graph}"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
