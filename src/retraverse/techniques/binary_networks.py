"""BinaryNet, FloppyNet, ShallowNet: networks of one bit a weight, trained for place recognition."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import parameter
from retraverse.techniques.preparing.caffe_input import cubic
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = [
    "BinaryNet",
    "BinaryNetParameters",
    "BinaryTechnique",
    "FloppyNet",
    "FloppyNetParameters",
    "ShallowNet",
    "ShallowNetParameters",
]

_SIDE = 227
_LENGTH = 256 * 6 * 6
_HELP = "name of stored weights, or the path of a .tflite"


class BinaryTechnique(LearnedTechnique):
    """The last pooled maps of a binary network, 256 x 6 x 6, as one unit vector.

    References
    ----------
    Ferrarini, Milford, McDonald-Maier, Ehsan: Binary Neural Networks for Memory-Efficient and
    Effective Visual Place Recognition in Changing Environments, T-RO 2022.
    """

    citation: ClassVar[str] = (
        "Ferrarini, Milford, McDonald-Maier, Ehsan: Binary Neural Networks for Memory-Efficient "
        "and Effective Visual Place Recognition in Changing Environments, T-RO 2022"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: LearnedParameters) -> None:
        super().__init__(parameters)
        self.layout = Layout("global", {"descriptor": ArraySpec((_LENGTH,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return 227 x 227 pixels (cubic), RGB, 0..1."""
        return channels_first(cubic(image, _SIDE, _SIDE).astype(np.float32) / 255)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network of this name."""
        from retraverse.techniques.networks.binary_alexnet import BinaryAlexNet

        network = BinaryAlexNet(self.name)
        network.load_named(tensors)
        return network


@dataclass(frozen=True)
class BinaryNetParameters(LearnedParameters):
    """Which weights."""

    weights: str = parameter("binarynet", _HELP, compared=False)


@dataclass(frozen=True)
class FloppyNetParameters(LearnedParameters):
    """Which weights."""

    weights: str = parameter("floppynet", _HELP, compared=False)


@dataclass(frozen=True)
class ShallowNetParameters(LearnedParameters):
    """Which weights."""

    weights: str = parameter("shallownet", _HELP, compared=False)


@register(BinaryNetParameters)
class BinaryNet(BinaryTechnique):
    """AlexNet's five convolutions with one bit a weight: 0.6 MB."""

    name: ClassVar[str] = "binarynet"
    summary: ClassVar[str] = "AlexNet's convolutions with one bit a weight, 0.6 MB"

    def __init__(self, parameters: BinaryNetParameters | None = None) -> None:
        super().__init__(parameters or BinaryNetParameters())


@register(FloppyNetParameters)
class FloppyNet(BinaryTechnique):
    """Three binary convolutions, the map's border counted as 1: 0.3 MB."""

    name: ClassVar[str] = "floppynet"
    summary: ClassVar[str] = "three convolutions with one bit a weight, 0.3 MB"

    def __init__(self, parameters: FloppyNetParameters | None = None) -> None:
        super().__init__(parameters or FloppyNetParameters())


@register(ShallowNetParameters)
class ShallowNet(BinaryTechnique):
    """Three binary convolutions, the map's border counted as 0: 0.3 MB."""

    name: ClassVar[str] = "shallownet"
    summary: ClassVar[str] = "as floppynet, with zeros around the maps"

    def __init__(self, parameters: ShallowNetParameters | None = None) -> None:
        super().__init__(parameters or ShallowNetParameters())
