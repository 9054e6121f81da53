"""Networks in 8-bit integers: ONNX graphs a quarter as large, and what that costs in likeness.

Static quantisation fixes the ranges of all that layers pass on by running the user's own pictures
of the reference drive; dynamic quantisation, which needs none, measures them anew at every run.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from retraverse.errors import InputError
from retraverse.files import check_writable_place, write_whole
from retraverse.images import Frame
from retraverse.techniques.base import Descriptions
from retraverse.techniques.running.extras import import_extra
from retraverse.techniques.running.learned import ONNX_SUFFIX, LearnedTechnique
from retraverse.techniques.running.onnx_runtime import INPUT_NAME, graph_bytes, quiet_exporter
from retraverse.types import FloatArray, Progress, no_progress

__all__ = ["QuantisedGraph", "quantise"]

MOST_CALIBRATION = 100
"""More pictures than this do not move the ranges, and all layers' outputs are held for each."""


@dataclass(frozen=True)
class QuantisedGraph:
    """A network in 8-bit integers on disk, and how far its descriptors are from the float ones."""

    path: Path
    n_bytes: int
    float_bytes: int
    """Of the same graph in float32."""
    method: str
    n_pictures: int
    """Pictures that the likeness below was measured on: those that were given."""
    mean_cosine: float
    """Between the int8 and the float descriptor of one picture, mean over the pictures."""
    least_cosine: float
    same_neighbour: float
    """Share of pictures whose most similar other picture stays the same, in [0, 1]."""

    def __str__(self) -> str:
        return (
            f"int8 ({self.method}): {self.n_bytes / 1e6:.1f} MB instead of "
            f"{self.float_bytes / 1e6:.1f}; cosine with the float descriptors "
            f"{self.mean_cosine:.4f} (least {self.least_cosine:.4f}), the most similar other "
            f"picture stays for {self.same_neighbour:.1%} of {self.n_pictures} pictures"
        )


def quantise(
    technique: LearnedTechnique,
    pictures: Sequence[Frame],
    path: Path,
    *,
    method: Literal["static", "dynamic"] = "static",
    progress: Progress = no_progress,
) -> QuantisedGraph:
    """Write a technique's network in 8-bit integers, and measure what its descriptors lose.

    ``technique(name, weights=path)`` runs it; a map tells it from the float network.

    Parameters
    ----------
    technique : LearnedTechnique
        With float weights.
    pictures : sequence of Frame
        Of the reference drive, at least two; up to 100 spread over it are used, all others not.
    path : Path
        What is written, ``*.onnx``.
    method : {"static", "dynamic"}
        See the module.
    progress : Progress
        Watches the pictures measured.

    Raises
    ------
    InputError
        If there are fewer than two pictures, or nothing can be written at `path`.
    DataMissingError
        If the weights are not there.
    MissingExtraError
        If PyTorch, onnx, onnxscript or ONNX Runtime is not installed.
    """
    if path.suffix != ONNX_SUFFIX:
        raise InputError(f"cannot write {path}: expected a name that ends with {ONNX_SUFFIX}")
    check_writable_place(path)
    if len(pictures) < 2:
        raise InputError(f"quantising: got {len(pictures)} pictures, expected at least 2")
    rows = np.unique(np.linspace(0, len(pictures) - 1, MOST_CALIBRATION).astype(int))
    chosen = [technique.read(pictures[row]) for row in rows]
    float_graph = graph_bytes(technique)
    prepared = [technique.prepare(image)[None] for image in chosen]
    write_whole(path, _quantised(float_graph, prepared, method))
    small = type(technique)(replace(technique.parameters, weights=str(path)))
    shown = list(progress(chosen, total=len(chosen), label="measuring int8 against float"))
    before, after = (
        Descriptions.stack((each.describe(image) for image in shown), each.layout)
        for each in (technique, small)
    )
    cosines = np.einsum("ij,ij->i", before.descriptor, after.descriptor)
    return QuantisedGraph(
        path=path,
        n_bytes=path.stat().st_size,
        float_bytes=len(float_graph),
        method=method,
        n_pictures=len(chosen),
        mean_cosine=float(cosines.mean()),
        least_cosine=float(cosines.min()),
        same_neighbour=float((_neighbour(technique, before) == _neighbour(small, after)).mean()),
    )


def _neighbour(technique: LearnedTechnique, described: Descriptions) -> Any:
    """Return the row of each picture's most similar other picture."""
    scores = technique.similarity(described, described)
    np.fill_diagonal(scores, -np.inf)
    return scores.argmax(axis=1)


def _quantised(
    graph: bytes, pictures: Sequence[FloatArray], method: Literal["static", "dynamic"]
) -> bytes:
    quantization: Any = import_extra("onnxruntime.quantization", "learned")
    shape_inference: Any = import_extra("onnxruntime.quantization.shape_inference", "learned")
    with tempfile.TemporaryDirectory() as folder, quiet_exporter():
        given, ready, done = (Path(folder) / f"{name}.onnx" for name in ("given", "ready", "done"))
        given.write_bytes(graph)
        # Folds batch normalisation into the convolutions before it: ranges are of what remains.
        shape_inference.quant_pre_process(str(given), str(ready), skip_symbolic_shape=True)
        if method == "dynamic":
            quantization.quantize_dynamic(
                str(ready), str(done), weight_type=quantization.QuantType.QUInt8
            )
        else:
            quantization.quantize_static(
                str(ready),
                str(done),
                _Calibration(pictures),
                quant_format=quantization.QuantFormat.QDQ,
                per_channel=True,
                activation_type=quantization.QuantType.QUInt8,
                weight_type=quantization.QuantType.QInt8,
            )
        return done.read_bytes()


class _Calibration:
    """Gives the quantiser one picture after another, as it asks for them."""

    def __init__(self, pictures: Sequence[FloatArray]) -> None:
        self._left = iter(pictures)

    def get_next(self) -> dict[str, FloatArray] | None:
        """Return the next picture under the graph's input name; None at the end."""
        picture = next(self._left, None)
        return None if picture is None else {INPUT_NAME: picture}
