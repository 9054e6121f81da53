"""DeepSeqSLAM: what a CNN sees in K successive frames, read by an LSTM trained on the map's drive.

Training makes one file for one map (`retraverse.training`); without it there is nothing to match
with. A frame's description is the CNN's; the LSTM works when whole drives are compared.
"""

import re
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from retraverse.errors import ConfigError, DataMissingError, InputError, ShapeError
from retraverse.images import Frame
from retraverse.techniques.base import BatchTechnique, Description, Descriptions, Technique
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.registry import register, technique
from retraverse.techniques.running.extras import import_extra
from retraverse.techniques.running.file_digest import file_digest
from retraverse.types import Array, FloatArray, ImageArray
from retraverse.weights.store import find_weights, load_tensors

if TYPE_CHECKING:
    from retraverse.techniques.networks.deepseqslam import DeepSeqSlamNet

__all__ = ["DeepSeqSlam", "DeepSeqSlamParameters", "frame_positions"]

_CNN = re.compile(r"(\w+)(?:\((.*)\))?")
_WINDOWS_AT_ONCE = 64


@dataclass(frozen=True)
class DeepSeqSlamParameters:
    """Which trained network, and on what descriptors."""

    weights: str = parameter(
        "deepseqslam",
        "network trained on the map's drive: a name in the store, or a path",
        compared=False,
    )
    cnn: str = parameter(
        "efficientnet(block=7, pooling=grid4_mean)",
        "technique whose descriptors are read, its parameters in brackets",
    )
    threads: int = parameter(1, "threads inside one run of the LSTM, 1 to 256", compared=False)

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_range("threads", self.threads, 1, 256)
        if not _CNN.fullmatch(self.cnn):
            raise ConfigError(
                f"deepseqslam cnn: got {self.cnn!r}, expected a technique, perhaps with "
                "parameters: 'efficientnet(block=7)'"
            )


@register(DeepSeqSlamParameters)
class DeepSeqSlam:
    """A CNN's descriptors, and an LSTM that tells where in the map's drive K of them are.

    `similarity` gives, for a window of K query frames, the probability of every place: row q is
    the window that begins with frame q, column r the place whose window begins with frame r. Rows
    after the last window continue it along its diagonal. The rows are answers for sequences
    already: match them with a sequence length of 1. Both drives must come whole.

    Notes
    -----
    Positions count frames, as odometry of constant steps would; `window_scores` takes real ones.
    The published program gives every frame its place on the line as position, the query's taken
    from the same file as the reference's, so that a network may read the answer off it; here only
    the way since a window's first frame is given, unless it was trained otherwise.

    References
    ----------
    Chancán, Milford: DeepSeqSLAM: A Trainable CNN+RNN for Joint Global Description and
    Sequence-based Place Recognition, 2020.
    """

    name: ClassVar[str] = "deepseqslam"
    summary: ClassVar[str] = "an LSTM on a CNN's descriptors, trained on the map's own drive"
    citation: ClassVar[str] = (
        "Chancán, Milford: DeepSeqSLAM: A Trainable CNN+RNN for Joint Global Description and "
        "Sequence-based Place Recognition, 2020"
    )
    version: ClassVar[int] = 1
    compares_whole_drives: ClassVar[bool] = True
    """Similarity in blocks would cut windows in two."""

    def __init__(self, parameters: DeepSeqSlamParameters | None = None) -> None:
        self.parameters = parameters or DeepSeqSlamParameters()
        self.cnn = _cnn(self.parameters.cnn)
        if self.cnn.layout.kind != "global":
            raise ConfigError(
                f"deepseqslam cnn: {self.cnn.name} describes regions, expected one vector a frame"
            )
        self.layout = self.cnn.layout
        self._lock = threading.RLock()
        self._network: DeepSeqSlamNet | None = None

    def read(self, frame: Frame) -> ImageArray:
        """Return the pixels that the CNN looks at."""
        return self.cnn.read(frame)

    def describe(self, image: ImageArray) -> Description:
        """Return the CNN's description of one picture."""
        return self.cnn.describe(image)

    def batch_size(self) -> int:
        """Return how many pictures at once are fastest for the CNN."""
        return self.cnn.batch_size() if isinstance(self.cnn, BatchTechnique) else 1

    def describe_batch(self, images: Sequence[ImageArray]) -> list[Description]:
        """Return the CNN's descriptions of several pictures."""
        if isinstance(self.cnn, BatchTechnique):
            return self.cnn.describe_batch(images)
        return [self.cnn.describe(image) for image in images]

    def fingerprint(self) -> str:
        """Return the SHA-256 of the trained network's file."""
        return file_digest(self._weights_path())

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R) in [0, 1]: the probability of every place, frame by frame.

        Raises
        ------
        InputError
            If the references are not as many as the drive it was trained on.
        """
        scores = np.zeros((len(queries), len(references)), np.float32)
        if not scores.size:
            return scores
        expected = self.network().n_frames
        if len(references) != expected:
            raise InputError(
                f"deepseqslam: the network was trained on a drive of {expected} frames, the map "
                f"has {len(references)}; train it on this map"
            )
        found = self.window_scores(queries.descriptor, frame_positions(len(queries)))
        n_windows, n_places = found.shape
        scores[:n_windows, :n_places] = found
        for after in range(1, len(queries) - n_windows + 1):
            row = scores[n_windows - 1 + after]
            row[after:] = scores[n_windows - 1, : len(references) - after]
        return scores

    def window_scores(self, descriptors: Array, positions: Array) -> FloatArray:
        """Return the probability of every place for every window, (Q - K + 1, R - K + 1).

        Parameters
        ----------
        descriptors : float32 array, shape (Q, D)
            Of a drive's frames, by the CNN; fewer than K are one short window.
        positions : float array, shape (Q, 2)
            Where each was taken, in any unit: by odometry, say.

        Raises
        ------
        ShapeError
            If they are not as many, or the network was trained on other descriptors.
        """
        import torch

        from retraverse.techniques.networks.deepseqslam import window_positions, windows
        from retraverse.techniques.running.torch_runtime import torch_threads

        network = self.network()
        _check_shapes(descriptors, positions, network.lstm.input_size - 2)
        length = min(int(network.sequence_length), len(descriptors))
        seen = windows(descriptors.astype(np.float32), length)
        where = window_positions(positions, length, network.position_mode)
        parts = []
        with torch_threads(self.parameters.threads), torch.inference_mode():
            for start in range(0, len(seen), _WINDOWS_AT_ONCE):
                part = slice(start, start + _WINDOWS_AT_ONCE)
                scores = network(torch.from_numpy(seen[part]), torch.from_numpy(where[part]))
                parts.append(torch.softmax(scores, dim=1).numpy())
        return np.concatenate(parts)

    def network(self) -> "DeepSeqSlamNet":
        """Return the LSTM in evaluation mode; loaded at the first call."""
        with self._lock:
            if self._network is None:
                path = self._weights_path()
                import_extra("torch", "learned")
                from retraverse.techniques.networks.deepseqslam import DeepSeqSlamNet

                network = DeepSeqSlamNet.from_tensors(load_tensors(path).tensors)
                self._network = network.eval().requires_grad_(False)
            return self._network

    def _weights_path(self) -> Any:
        try:
            return find_weights(self.parameters.weights)
        except DataMissingError as error:
            raise DataMissingError(
                f"deepseqslam: no network {self.parameters.weights!r} here; train one on the "
                "map's drive (retraverse train deepseqslam) and set the parameter weights to its "
                "file"
            ) from error


def frame_positions(count: int) -> FloatArray:
    """Return positions of a drive without odometry: one step a frame along a line, (count, 2)."""
    return np.stack([np.arange(count), np.zeros(count)], axis=1).astype(np.float32)


def _cnn(text: str) -> Technique:
    """Return the technique that ``name(parameter=value, ...)`` says."""
    found = _CNN.fullmatch(text)
    assert found is not None
    settings = [part.partition("=") for part in (found[2] or "").split(",") if part.strip()]
    values = {name.strip(): value.strip() for name, _, value in settings}
    return technique(found[1], **values)


def _check_shapes(descriptors: Array, positions: Array, dimension: int) -> None:
    if descriptors.ndim != 2 or descriptors.shape[1] != dimension:
        raise ShapeError(
            f"deepseqslam: got descriptors of shape {descriptors.shape}, expected (frames, "
            f"{dimension}): the network was trained on another cnn?"
        )
    if positions.shape != (len(descriptors), 2):
        raise ShapeError(
            f"deepseqslam: got positions of shape {positions.shape}, expected "
            f"({len(descriptors)}, 2)"
        )
