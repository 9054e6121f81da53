"""EfficientNet-Lite0, its middle: what a network trained to name things sees of a place.

Block and pooling were picked by measurement, snow against autumn (``stromovka``, ± 2 frames) and
winter against summer (``nordland_64x32``, every 20th frame, ± 1); the mean accuracy of both, at
K = 1 and 10, decided, and among equals the shorter vector. ``benchmarks/efficientnet_blocks.py``
prints all 98 choices; the best of some of them:

======  ==========  ======  =====  =========  ==========  ========  =========  ========
block   pooling     values  mean   stromovka  K = 10      nordland  K = 10     corridor
======  ==========  ======  =====  =========  ==========  ========  =========  ========
9       flat        21,952  .843   .594       .989        .788      1.000      .676
11      flat         9,408  .838   .653       1.000       .698      1.000      .883
7       flat        15,680  .817   .525       .989        .754      1.000      .766
9       grid4_mean   1,792  .805   .634       .978        .609      1.000      .820
12      flat         9,408  .786   .554       .935        .654      1.000      .802
15      flat        15,680  .604   .267       .826        .330      .994       .712
12      mean           192  .569   .347       .717        .223      .988       .658
======  ==========  ======  =====  =========  ==========  ========  =========  ========

Blocks 9 and 11 are within each other's error (101 and 179 frames); 11 stands a change of
viewpoint, which neither of the two drives has much of, far better. Pooling over all of the
picture forgets what tells one place from the next.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.network_input import channels_first, resized
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.techniques.summarising.pooling import pool, pooled_length
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["EfficientNet", "EfficientNetParameters"]

_SHIPPED = Path(__file__).parents[1] / "weights" / "shipped"
"""Where weights that come with this program lie, ``efficientnet_<name>.safetensors``."""
_BLOCKS = (
    (16, 2), (24, 4), (24, 4), (40, 8), (40, 8), (80, 16), (80, 16), (80, 16), (112, 16),
    (112, 16), (112, 16), (192, 32), (192, 32), (192, 32), (192, 32), (320, 32),
)  # fmt: skip
"""Channels of each block's output, and how many pixels apart its positions are."""


@dataclass(frozen=True)
class EfficientNetParameters(LearnedParameters):
    """Where the network is cut, and how what comes out there is pooled."""

    weights: str = parameter(
        "efficientnet-lite0",
        "efficientnet-lite0 (the extra learned brings them), a name in the store, or a file's path",
        compared=False,
    )
    block: int = parameter(11, "the last block of the network that is run, 0 to 15")
    pooling: Literal[
        "flat", "mean", "gem", "grid2_max", "grid2_mean", "grid4_max", "grid4_mean"
    ] = parameter(
        "flat", "all positions, their mean, generalised mean, or a grid of maxima or means"
    )
    resolution: int = parameter(224, "side in pixels of the square picture, 64 to 1024")

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_range("efficientnet block", self.block, 0, len(_BLOCKS) - 1)
        check_range("efficientnet resolution", self.resolution, 64, 1024)

    @property
    def feature_shape(self) -> tuple[int, int, int]:
        """Channels, height and width of the block's output."""
        channels, stride = _BLOCKS[self.block]
        side = -(-self.resolution // stride)
        return channels, side, side


@register(EfficientNetParameters)
class EfficientNet(LearnedTechnique):
    """Feature maps from the middle of EfficientNet-Lite0, one unit vector a picture.

    References
    ----------
    Tan, Le: EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks, ICML 2019;
    the Lite variant of the TensorFlow project, 2020, with its published ImageNet weights.
    """

    name: ClassVar[str] = "efficientnet"
    summary: ClassVar[str] = "the middle of a small network trained on ImageNet: works as installed"
    citation: ClassVar[str] = (
        "Tan, Le: EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks, "
        "ICML 2019 (Lite0)"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: EfficientNetParameters | None = None) -> None:
        parameters = parameters or EfficientNetParameters()
        super().__init__(parameters)
        length = pooled_length(parameters.feature_shape, parameters.pooling)
        self.layout = Layout("global", {"descriptor": ArraySpec((length,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the square picture, RGB, ``(pixel - 127) / 128``: as the weights were trained."""
        side = self.parameters.resolution
        pixels = channels_first(resized(image, side, side))
        return (pixels - np.float32(127)) / np.float32(128)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network cut after the block."""
        from retraverse.techniques.networks.efficientnet_lite import EfficientNetLite0

        network = EfficientNetLite0(n_blocks=self.parameters.block + 1)
        network.load_named(tensors)
        return network

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the pooled vectors."""
        return pool(outputs, self.parameters.pooling)

    def weights_path(self) -> Path:
        """Return the file of weights that come with this program, or of any others.

        Raises
        ------
        DataMissingError
            If there is none; says how it comes here.
        """
        shipped = _SHIPPED / f"efficientnet_{self.parameters.weights}.safetensors"
        return shipped if shipped.is_file() else super().weights_path()
