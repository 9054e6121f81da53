"""AlexNet: the third convolution, projected at random, or the first fully connected layer."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.networks.caffe_tables import (
    ALEXNET,
    CAFFENET,
    graph_of,
    output_shape,
    until,
)
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.caffe_input import (
    IMAGENET_MEAN_BGR,
    ChannelOrder,
    cubic,
    equalised,
    in_order,
    smooth,
)
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.techniques.summarising.pooling import flat
from retraverse.techniques.summarising.random_projection import gaussian_projection
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["AlexNet", "AlexNetParameters"]

_SIDE = 227
_TABLES = {"alexnet": ALEXNET, "caffenet": CAFFENET}
_BLOBS = {"conv3": "relu3", "fc6": "relu6"}


@dataclass(frozen=True)
class AlexNetParameters(LearnedParameters):
    """Which layer, and how the picture is fed to it."""

    weights: str = parameter(
        "alexnet", "name of stored weights, or the path of a .caffemodel", compared=False
    )
    layer: Literal["conv3", "fc6"] = parameter(
        "conv3", "conv3, projected at random (VPR-Bench), or fc6 (chapter 5)"
    )
    projection: int = parameter(
        1064, "length of the random projection of conv3, 0 to 64896; 0 = conv3 as it is"
    )
    network: Literal["alexnet", "caffenet"] = parameter(
        "alexnet", "alexnet, or caffenet, which pools before it normalises: Places365's weights"
    )
    channels: ChannelOrder = parameter(
        "rgb", "order of the channels for conv3: rgb as in VPR-Bench, bgr as trained"
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_range("alexnet projection", self.projection, 0, 384 * 13 * 13)


@register(AlexNetParameters)
class AlexNet(LearnedTechnique):
    """AlexNet after a ReLU: ``conv3`` (384 x 13 x 13) or ``fc6`` (4096), one unit vector.

    For conv3 the luminance is equalised, the picture made 227 x 227 and fed as 0..1 without a
    mean; a seeded Gaussian matrix makes 1064 numbers of the 64,896. For fc6 the picture is
    prepared as the network was trained: blue first, 0..255 less the mean colour.

    References
    ----------
    Krizhevsky, Sutskever, Hinton: ImageNet Classification with Deep Convolutional Neural
    Networks, NIPS 2012; as used by Merrill, Huang: Lightweight Unsupervised Deep Loop Closure,
    RSS 2018, section V (conv3 at CALC's length), and by VPR-Bench.
    """

    name: ClassVar[str] = "alexnet"
    summary: ClassVar[str] = "AlexNet's conv3, projected at random, or its fc6"
    citation: ClassVar[str] = (
        "Krizhevsky, Sutskever, Hinton: ImageNet Classification with Deep Convolutional Neural "
        "Networks, NIPS 2012"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: AlexNetParameters | None = None) -> None:
        parameters = parameters or AlexNetParameters()
        super().__init__(parameters)
        self._table = until(_TABLES[parameters.network], _BLOBS[parameters.layer])
        self._length = int(np.prod(output_shape(self._table, (3, _SIDE, _SIDE))))
        self._projects = parameters.layer == "conv3" and parameters.projection > 0
        length = parameters.projection if self._projects else self._length
        self.layout = Layout("global", {"descriptor": ArraySpec((length,), "float32")})
        self._projection: FloatArray | None = None

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return 227 x 227 pixels as the layer's users feed them."""
        if self.parameters.layer == "fc6":
            blue_first = in_order(smooth(image, _SIDE), "bgr")
            return channels_first(blue_first - np.array(IMAGENET_MEAN_BGR, np.float32))
        picture = cubic(equalised(image), _SIDE, _SIDE).astype(np.float32) / np.float32(255)
        return channels_first(in_order(picture, self.parameters.channels))

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network cut after the layer's ReLU."""
        from retraverse.techniques.networks.caffe_net import CaffeNet

        return CaffeNet(graph_of(self._table, (3, _SIDE, _SIDE), "AlexNet"), tensors)

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the layer flattened, and projected if it is conv3."""
        if not self._projects:
            return flat(outputs)
        with self._lock:
            if self._projection is None:
                self._projection = gaussian_projection(self.parameters.projection, self._length)
        return np.asarray(flat(outputs) @ self._projection.T, dtype=np.float32)
