"""NetVLAD: VGG16, 64 clusters learned with it, and whitening."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from retraverse.errors import ConfigError
from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.caffe_input import cubic
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["NetVlad", "NetVladParameters"]

_WHITENED, _RAW = 4096, 512 * 64


@dataclass(frozen=True)
class NetVladParameters(LearnedParameters):
    """Which weights, how long the descriptor, and the size of the picture."""

    weights: str = parameter(
        "netvlad-pitts30k",
        "name of stored weights, or the path of a .mat, TensorFlow or PyTorch file",
        compared=False,
    )
    dimension: int = parameter(
        4096, "numbers kept after whitening, 1 to 4096; 32768 = not whitened"
    )
    width: int = parameter(640, "width of the picture in pixels, 32 to 4096")
    height: int = parameter(480, "height of the picture in pixels, 32 to 4096")

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.dimension != _RAW and not 1 <= self.dimension <= _WHITENED:
            raise ConfigError(
                f"netvlad dimension: got {self.dimension}, expected 1 to {_WHITENED}, or {_RAW} "
                "for no whitening"
            )
        check_range("netvlad width", self.width, 32, 4096)
        check_range("netvlad height", self.height, 32, 4096)


@register(NetVladParameters)
class NetVlad(LearnedTechnique):
    """NetVLAD on conv5_3 of VGG16, whitened to 4096 numbers, on 640 x 480 pixels.

    Notes
    -----
    VPR-Bench feeds its queries blue first and its references red first; here both are red first.

    References
    ----------
    Arandjelović, Gronat, Torii, Pajdla, Sivic: NetVLAD: CNN architecture for weakly supervised
    place recognition, CVPR 2016.
    """

    name: ClassVar[str] = "netvlad"
    summary: ClassVar[str] = "NetVLAD: VGG16 with learned clusters, bears change of viewpoint; slow"
    citation: ClassVar[str] = (
        "Arandjelović, Gronat, Torii, Pajdla, Sivic: NetVLAD: CNN architecture for weakly "
        "supervised place recognition, CVPR 2016"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: NetVladParameters | None = None) -> None:
        parameters = parameters or NetVladParameters()
        super().__init__(parameters)
        self.layout = Layout(
            "global", {"descriptor": ArraySpec((parameters.dimension,), "float32")}
        )

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture at its size (cubic), RGB, 0..255."""
        resized = cubic(image, self.parameters.height, self.parameters.width)
        return channels_first(resized.astype(np.float32))

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return VGG16 with NetVLAD and, unless all 32768 numbers are asked for, whitening."""
        from retraverse.techniques.networks.vgg_netvlad import VggNetVlad

        network = VggNetVlad(self.parameters.dimension)
        network.load_named(tensors)
        return network
