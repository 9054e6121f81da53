"""SALAD: patches of DINOv2, shared out among clusters by optimal transport."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_multiple, parameter
from retraverse.techniques.preparing.published_input import imagenet_normalised, resized_8_bit
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["DESCRIPTOR_LENGTH", "LARGEST_SIDE", "LEAST_SIDE", "PATCH", "Salad", "SaladParameters"]

PATCH = 14
LEAST_SIDE, LARGEST_SIDE = 126, 1022
"""There must be more patches than the 64 clusters: 9 x 9 of them at least."""
DESCRIPTOR_LENGTH = 8448


@dataclass(frozen=True)
class SaladParameters(LearnedParameters):
    """How large the picture is."""

    weights: str = parameter("salad", "name of stored weights, or a file", compared=False)
    resolution: int = parameter(
        322, "side in pixels of the square picture, 126 to 1022, a multiple of 14"
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_multiple("salad resolution", self.resolution, PATCH, LEAST_SIDE, LARGEST_SIDE)


@register(SaladParameters)
class Salad(LearnedTechnique):
    """DINOv2 (ViT-B/14) and SALAD's aggregation; 8448 numbers, cosine of unit vectors.

    Pictures are made square (Pillow, bilinear), RGB, ImageNet's mean and deviation.

    References
    ----------
    Izquierdo, Civera: Optimal Transport Aggregation for Visual Place Recognition, CVPR 2024; the
    authors' released weights.
    """

    name: ClassVar[str] = "salad"
    summary: ClassVar[str] = "DINOv2's patches by optimal transport: among the best, and heavy"
    citation: ClassVar[str] = (
        "Izquierdo, Civera: Optimal Transport Aggregation for Visual Place Recognition, CVPR 2024"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: SaladParameters | None = None) -> None:
        super().__init__(parameters or SaladParameters())
        self.layout = Layout("global", {"descriptor": ArraySpec((DESCRIPTOR_LENGTH,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the square picture, RGB, normalised."""
        side = self.parameters.resolution
        return imagenet_normalised(resized_8_bit(image, side, side, "bilinear"))

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with the official checkpoint's weights."""
        from retraverse.techniques.networks.published import unfilled
        from retraverse.techniques.networks.salad import SaladNet

        network = unfilled(SaladNet)
        network.load_named(tensors)
        return network
