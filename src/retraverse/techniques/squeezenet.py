"""SqueezeNet v1.0: the middle of a network of 1.2 million weights, trained on ImageNet."""

from collections.abc import Mapping
from dataclasses import dataclass
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

__all__ = ["SqueezeNet", "SqueezeNetParameters"]

_SIDE = 227
_MEAN_BGR = np.array([104, 117, 123], np.float32)
_CHANNELS = {2: 128, 3: 128, 4: 256, 5: 256, 6: 384, 7: 384, 8: 512, 9: 512}
_MAP_SIDE = {2: 55, 3: 55, 4: 55, 5: 27, 6: 27, 7: 27, 8: 27, 9: 13}


@dataclass(frozen=True)
class SqueezeNetParameters(LearnedParameters):
    """Where the network is cut, and how what comes out there is pooled."""

    weights: str = parameter(
        "squeezenet",
        "name of stored weights, or the path of a .caffemodel, .npz or .safetensors",
        compared=False,
    )
    fire: int = parameter(9, "the last fire module that is run, 2 to 9")
    pooling: Literal[
        "flat", "mean", "gem", "grid2_max", "grid2_mean", "grid4_max", "grid4_mean"
    ] = parameter(
        "flat", "all positions, their mean, generalised mean, or a grid of maxima or means"
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_range("squeezenet fire", self.fire, min(_CHANNELS), max(_CHANNELS))

    @property
    def feature_shape(self) -> tuple[int, int, int]:
        """Channels, height and width of the fire module's output."""
        return _CHANNELS[self.fire], _MAP_SIDE[self.fire], _MAP_SIDE[self.fire]


@register(SqueezeNetParameters)
class SqueezeNet(LearnedTechnique):
    """Feature maps of SqueezeNet v1.0, one unit vector a picture.

    References
    ----------
    Iandola, Han, Moskewicz, Ashraf, Dally, Keutzer: SqueezeNet: AlexNet-level accuracy with 50x
    fewer parameters and <0.5MB model size, 2016.
    """

    name: ClassVar[str] = "squeezenet"
    summary: ClassVar[str] = "SqueezeNet's last feature maps: a network of 1.2 million weights"
    citation: ClassVar[str] = (
        "Iandola, Han, Moskewicz, Ashraf, Dally, Keutzer: SqueezeNet: AlexNet-level accuracy with "
        "50x fewer parameters and <0.5MB model size, 2016"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: SqueezeNetParameters | None = None) -> None:
        parameters = parameters or SqueezeNetParameters()
        super().__init__(parameters)
        length = pooled_length(parameters.feature_shape, parameters.pooling)
        self.layout = Layout("global", {"descriptor": ArraySpec((length,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return 227 x 227 pixels, BGR, 0 to 255 less the mean: as the weights were trained."""
        blue_first = resized(image, _SIDE, _SIDE)[:, :, ::-1].astype(np.float32)
        return channels_first(blue_first - _MEAN_BGR)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network cut after the fire module."""
        from retraverse.techniques.networks.squeezenet import SqueezeNet as Network

        network = Network(last_fire=self.parameters.fire)
        network.load_named(tensors)
        return network

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the pooled vectors."""
        return pool(outputs, self.parameters.pooling)
