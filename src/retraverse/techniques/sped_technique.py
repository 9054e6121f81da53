"""What AMOSNet and HybridNet share: one network, its fifth convolution in 30 parts, and L1.

Of each of 256 maps the maximum is taken over the whole, and over 2 x 2, 3 x 3 and 4 x 4 parts. The
parts are those of the authors' program as VPR-Bench runs it: between two parts a row and column of
the 13 x 13 are left out, and so are the last ones.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.networks.caffe_tables import SPED_NET, graph_of, until
from retraverse.techniques.parameters import parameter
from retraverse.techniques.preparing.caffe_input import find_mean, in_order, read_mean, smooth
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.running.file_digest import file_digest
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["N_PARTS", "SpedParameters", "SpedTechnique", "l1_similarity", "pyramid_maxima"]

_INPUT = (3, 227, 227)
_TABLE = until(SPED_NET, "relu5")
_N_MAPS = 256
_PARTS = (
    ((0, 13),),
    ((0, 6), (7, 12)),
    ((0, 4), (5, 8), (9, 12)),
    ((0, 3), (4, 6), (7, 9), (10, 12)),
)
"""Per level: first and last (exclusive) row, or column, of each part."""
N_PARTS = sum(len(level) ** 2 for level in _PARTS)
_SCALE = 256.0 * 256.0
_BLOCK_VALUES = 1 << 22
"""How many differences are held at once."""


@dataclass(frozen=True)
class SpedParameters(LearnedParameters):
    """Which weights, and which mean image."""

    mean: str = parameter(
        "hybridnet-mean",
        "mean image: a name in the store, a path (.npy, .binaryproto), or colour = ImageNet's",
        compared=False,
    )


class SpedTechnique(LearnedTechnique):
    """Maxima of 256 maps over 30 parts, compared by the sum of absolute differences."""

    def __init__(self, parameters: SpedParameters) -> None:
        super().__init__(parameters)
        self.layout = Layout("global", {"descriptor": ArraySpec((_N_MAPS * N_PARTS,), "float32")})
        self._mean: FloatArray | None = None

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return 227 x 227 pixels, blue first, 0..255 less the mean image."""
        with self._lock:
            if self._mean is None:
                self._mean = read_mean(find_mean(self.parameters.mean), _INPUT[1])
        return channels_first(in_order(smooth(image, _INPUT[1]), "bgr") - self._mean)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network cut after the ReLU of conv5."""
        from retraverse.techniques.networks.caffe_net import CaffeNet

        return CaffeNet(graph_of(_TABLE, _INPUT, self.name), tensors)

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the 30 maxima of each of 256 maps, (N, 7680)."""
        return pyramid_maxima(outputs).reshape(len(outputs), -1)

    def finish(self, outputs: FloatArray) -> list[Description]:
        """Return the maxima as they are: their size counts."""
        return [{"descriptor": row} for row in self.pool(outputs)]

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return ``1 - sum|q - r| / 256**2``; 0 where either has no descriptor."""
        return l1_similarity(queries.descriptor, references.descriptor)

    def fingerprint(self) -> str:
        """Return the SHA-256 of the weights' and the mean image's checksums."""
        mean = find_mean(self.parameters.mean)
        both = super().fingerprint() + (file_digest(mean) if mean else self.parameters.mean)
        return hashlib.sha256(both.encode()).hexdigest()


def pyramid_maxima(maps: FloatArray) -> FloatArray:
    """Return the maxima over the 30 parts, (N, C, 30).

    Parameters
    ----------
    maps : float32 array, shape (N, C, 13, 13)
    """
    maxima = [
        maps[:, :, top:bottom, left:right].max(axis=(2, 3))
        for level in _PARTS
        for top, bottom in level
        for left, right in level
    ]
    return np.stack(maxima, axis=2)


def l1_similarity(queries: Array, references: Array) -> FloatArray:
    """Return ``1 - sum|q - r| / 256**2`` of every pair, float32 (Q, R).

    A row of zeros says "no descriptor": its similarity with anything is 0.
    """
    scores = np.empty((len(queries), len(references)), np.float32)
    step = max(1, _BLOCK_VALUES // max(1, references.shape[1]))
    for start in range(0, len(references), step):
        block = references[start : start + step]
        for row, query in enumerate(queries):
            distances = np.abs(block - query).sum(axis=1)
            scores[row, start : start + step] = 1 - distances / np.float32(_SCALE)
    scores[~queries.any(axis=1)] = 0
    scores[:, ~references.any(axis=1)] = 0
    return scores
