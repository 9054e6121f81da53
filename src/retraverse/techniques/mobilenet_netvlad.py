"""MobileNetV2-NetVLAD: a small NetVLAD trained on triplets of street views."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["MobileNetNetVlad", "MobileNetNetVladParameters"]

_LENGTH = 16 * 64


@dataclass(frozen=True)
class MobileNetNetVladParameters(LearnedParameters):
    """Which weights, and the size of the picture."""

    weights: str = parameter(
        "mobilenetv2-netvlad", "name of stored weights, or the path of a .h5 or .pb", compared=False
    )
    width: int = parameter(640, "width of the picture in pixels, 32 to 4096; trained at 320")
    height: int = parameter(480, "height of the picture in pixels, 32 to 4096; trained at 240")

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_range("mobilenetv2_netvlad width", self.width, 32, 4096)
        check_range("mobilenetv2_netvlad height", self.height, 32, 4096)


@register(MobileNetNetVladParameters)
class MobileNetNetVlad(LearnedTechnique):
    """MobileNetV2 up to block 9 and NetVLAD of 16 clusters: one unit vector of 1024.

    References
    ----------
    Kuse, Shen: Learning Whole-Image Descriptors for Real-time Loop Detection and Kidnap Recovery
    under Large Viewpoint Difference, Robotics and Autonomous Systems 2021, section 3.
    """

    name: ClassVar[str] = "mobilenetv2_netvlad"
    summary: ClassVar[str] = "NetVLAD on a tenth of a MobileNetV2, trained on street views, 1.3 MB"
    citation: ClassVar[str] = (
        "Kuse, Shen: Learning Whole-Image Descriptors for Real-time Loop Detection and Kidnap "
        "Recovery under Large Viewpoint Difference, Robotics and Autonomous Systems 2021"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: MobileNetNetVladParameters | None = None) -> None:
        super().__init__(parameters or MobileNetNetVladParameters())
        self.layout = Layout("global", {"descriptor": ArraySpec((_LENGTH,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture at its size, blue first, about -1 to 1."""
        import cv2

        size = (self.parameters.width, self.parameters.height)
        blue_first = cv2.resize(image, size)[:, :, ::-1].astype(np.float32)
        return channels_first((blue_first - 128) * 2 / 255)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with its NetVLAD layer."""
        from retraverse.techniques.networks.mobilenet_netvlad import MobileNetNetVlad as Network

        network = Network()
        network.load_named(tensors)
        return network
