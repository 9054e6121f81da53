"""What all techniques with a trained network share: weights, batches, runtimes, unit vectors.

A new one is one file of this room with a subclass of `LearnedTechnique`. It defines

- ``name``, ``summary``, ``citation``, ``version``, as every technique;
- a parameter dataclass that extends `LearnedParameters` (its ``weights`` has the default name);
- ``layout``, set in ``__init__`` from the parameters alone: known before any weights are;
- `LearnedTechnique.prepare`: a picture to the network's input, float32 (C, H, W), one fixed shape;
- `LearnedTechnique.build_network`: the published tensors to a PyTorch module, input (N, C, H, W),
  output one tensor with a leading axis N: feature maps, or the descriptor itself;
- if need be `LearnedTechnique.pool`: that output to vectors (N, D), in NumPy; see ``pooling``;
- if need be `LearnedTechnique.weights_path`: where the file lies (default: the weights store);
- if need be `LearnedTechnique.finish`, `read` and `similarity`: descriptions of more than one
  array, grey pictures, another measure than the cosine.

Nothing here imports PyTorch before the first description.
"""

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.images import STRONG_TRACES, Frame, jpeg_traces
from retraverse.techniques.base import Description, Descriptions, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.running.batching import Runner, fastest_batch, slices
from retraverse.techniques.running.extras import import_extra
from retraverse.techniques.running.file_digest import file_digest
from retraverse.techniques.summarising.pooling import flat, unit_rows
from retraverse.techniques.summarising.vectors import cosine_similarity
from retraverse.types import Array, FloatArray, ImageArray
from retraverse.weights.store import (
    CLEAN_WEIGHTS,
    find_weights,
    load_tensors,
    weights_metadata,
)

if TYPE_CHECKING:
    import torch

__all__ = ["LearnedParameters", "LearnedTechnique", "Runner"]

Runtime = Literal["torch", "onnx"]
ONNX_SUFFIX = ".onnx"
SAME = "same"


@dataclass(frozen=True)
class LearnedParameters:
    """Which weights, and what runs them: what every technique with a network has.

    A map records all of these. It is refused for other weights, by their content, not by their
    name; for another runtime, number of threads or batch it is not: those change the last digits
    of a float only.
    """

    weights: str = parameter(
        "", "name of stored weights, or the path of a weights file", compared=False
    )
    clean_weights: str = parameter(
        "auto",
        "other weights for pictures that show no strong JPEG: a name, a path, same (none), or "
        "auto (those that a tuning for JPEG began with, where the weights say so)",
        compared=False,
    )
    runtime: Runtime = parameter(
        "torch", "what runs the network: torch (PyTorch) or onnx (ONNX Runtime)", compared=False
    )
    threads: int = parameter(1, "threads inside one run of the network, 1 to 256", compared=False)
    batch: int = parameter(
        0, "pictures in one run of the network, 1 to 256; 0 = the measured best", compared=False
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range("threads", self.threads, 1, 256)
        check_range("batch", self.batch, 0, 256)


class LearnedTechnique(ABC):
    """A picture through a trained network: one unit vector a frame, compared by the cosine.

    A picture of one single colour has no descriptor (zeros), as with every technique here.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    citation: ClassVar[str]
    version: ClassVar[int]
    layout: Layout

    def __init__(self, parameters: LearnedParameters) -> None:
        self.parameters: Any = parameters
        self._lock = threading.RLock()
        self._network: torch.nn.Module | None = None
        self._runner: Runner | None = None
        self._fingerprint: str | None = None
        self._for_clean: LearnedTechnique | None = None
        self._batch_size = parameters.batch

    # What a subclass defines.

    @abstractmethod
    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the network's input for one picture as `read` gave it: float32 (C, H, W)."""

    @abstractmethod
    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with these weights: (N, C, H, W) in, (N, ...) out.

        Raises
        ------
        InputError
            If a tensor is missing or of another shape: weights of another network.
        """

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the vectors (N, D) of the network's outputs (N, ...); here: flattened."""
        return flat(outputs)

    def finish(self, outputs: FloatArray) -> list[Description]:
        """Return the descriptions of the network's outputs: here pooled unit vectors."""
        return [{"descriptor": row} for row in unit_rows(self.pool(outputs))]

    def weights_path(self) -> Path:
        """Return the weights file that the parameters name.

        Raises
        ------
        DataMissingError
            If it is not there, with what to do.
        """
        return find_weights(self.parameters.weights)

    # What maps and matchers ask for.

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in colour, RGB."""
        return frame.colour()

    def describe(self, image: ImageArray) -> Description:
        """Return the description of one picture."""
        return self.describe_batch([image])[0]

    def describe_batch(self, images: Sequence[ImageArray]) -> list[Description]:
        """Return the descriptions of several pictures, run `batch_size` at a time.

        As one by one, within the rounding of float32. Thread-safe.

        Raises
        ------
        DataMissingError
            If the weights are not there.
        MissingExtraError
            If the runtime is not installed.
        """
        other = self.for_clean_pictures()
        if other is None:
            return self._describe_alike(images)
        # Each picture by the network that was made for it; both answer in the same terms.
        harmed = [jpeg_traces(image) >= STRONG_TRACES for image in images]
        described: dict[int, Description] = {}
        for technique, is_meant in ((self, True), (other, False)):
            rows = [row for row, strong in enumerate(harmed) if strong is is_meant]
            chosen = technique._describe_alike([images[row] for row in rows])
            described |= zip(rows, chosen, strict=True)
        return [described[row] for row in range(len(images))]

    def _describe_alike(self, images: Sequence[ImageArray]) -> list[Description]:
        if len(images) <= 1:
            return self._describe_at_once(images)
        parts = slices(len(images), self.batch_size())
        return [one for part in parts for one in self._describe_at_once(images[part])]

    def batch_size(self) -> int:
        """Return how many pictures run through the network at once.

        Measured at the first call, unless the parameters say: the largest that is clearly faster
        than smaller ones, so never slower than one by one.
        """
        with self._lock:
            if not self._batch_size:
                self._batch_size = fastest_batch(self.runner(), self.input_shape())
            return self._batch_size

    def _describe_at_once(self, images: Sequence[ImageArray]) -> list[Description]:
        if not images:
            return []
        outputs = self.runner()(np.stack([self.prepare(image) for image in images]))
        return [
            description if _has_contrast(image) else _no_place(description)
            for image, description in zip(images, self.finish(outputs), strict=True)
        ]

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return the cosine of every pair (equation 4.1)."""
        return cosine_similarity(queries, references, non_negative=False)

    def fingerprint(self) -> str:
        """Return the SHA-256 of the weights, in hexadecimal: part of a map's identity.

        Of the file; with other weights for clean pictures, of both files' and the threshold.

        Raises
        ------
        DataMissingError
            If it is not there.
        """
        with self._lock:
            if self._fingerprint is None:
                own, other = file_digest(self.weights_path()), self.for_clean_pictures()
                both = "" if other is None else f"{own} {other.fingerprint()} {STRONG_TRACES}"
                self._fingerprint = sha256(both.encode()).hexdigest() if both else own
            return self._fingerprint

    def for_clean_pictures(self) -> "LearnedTechnique | None":
        """Return what describes pictures without strong traces of JPEG, None if this does.

        Raises
        ------
        DataMissingError
            If the weights are not there.
        """
        with self._lock:
            name = self._clean_weights()
            if name and self._for_clean is None:
                plain = replace(self.parameters, weights=name, clean_weights=SAME)
                self._for_clean = type(self)(plain)
            return self._for_clean

    def _clean_weights(self) -> str:
        """Return the name of the weights for clean pictures, "" if there are none."""
        asked = str(getattr(self.parameters, "clean_weights", SAME))
        if asked == "auto":
            return weights_metadata(self.weights_path()).get(CLEAN_WEIGHTS, "")
        return "" if asked == SAME else asked

    # The network itself.

    def input_shape(self) -> tuple[int, int, int]:
        """Return channels, height and width of the network's input."""
        channels, height, width = self.prepare(np.zeros((64, 64, 3), np.uint8)).shape
        return channels, height, width

    def network(self) -> "torch.nn.Module":
        """Return the PyTorch module, in evaluation mode; made and loaded at the first call."""
        with self._lock:
            if self._network is None:
                import_extra("torch", "learned")
                path = self.weights_path()
                if path.suffix == ONNX_SUFFIX:
                    raise ConfigError(
                        f"weights {path}: a graph for ONNX Runtime, expected weights of a "
                        f"PyTorch network of {self.name}"
                    )
                network = self.build_network(load_tensors(path).tensors)
                self._network = network.eval().requires_grad_(False)
            return self._network

    def runner(self) -> Runner:
        """Return what runs the network: the runtime that the parameters name.

        Weights that are an ``.onnx`` file are a whole graph, and run by ONNX Runtime.
        """
        with self._lock:
            if self._runner is None:
                is_graph = self.weights_path().suffix == ONNX_SUFFIX
                runtime = "onnx" if is_graph else self.parameters.runtime
                self._runner = _RUNNERS[runtime](self)
            return self._runner


def _torch_runner(technique: LearnedTechnique) -> Runner:
    from retraverse.techniques.running.torch_runtime import TorchRunner

    return TorchRunner(technique.network(), technique.parameters.threads)


def _onnx_runner(technique: LearnedTechnique) -> Runner:
    from retraverse.techniques.running.onnx_runtime import onnx_runner

    return onnx_runner(technique)


_RUNNERS = {"torch": _torch_runner, "onnx": _onnx_runner}


def _has_contrast(image: ImageArray) -> bool:
    first = image[:1, :1]
    # Most pictures tell by their first row already.
    return bool((image[:1] != first).any() or (image != first).any())


def _no_place(description: Description) -> Description:
    return {name: np.zeros_like(array) for name, array in description.items()}
