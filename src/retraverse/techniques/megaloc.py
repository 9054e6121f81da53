"""MegaLoc: SALAD's network, larger, trained on five kinds of places at once."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_multiple, parameter
from retraverse.techniques.preparing.published_input import imagenet_normalised, resized_float
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.techniques.salad import DESCRIPTOR_LENGTH, LARGEST_SIDE, LEAST_SIDE, PATCH
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["MegaLoc", "MegaLocParameters"]


@dataclass(frozen=True)
class MegaLocParameters(LearnedParameters):
    """How large the picture is."""

    weights: str = parameter("megaloc", "name of stored weights, or a file", compared=False)
    resolution: int = parameter(
        322,
        "side in pixels of the square picture, 126 to 1022, a multiple of 14; "
        "0 = its own size to the nearest multiple",
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.resolution:
            check_multiple("megaloc resolution", self.resolution, PATCH, LEAST_SIDE, LARGEST_SIDE)


@register(MegaLocParameters)
class MegaLoc(LearnedTechnique):
    """DINOv2 (ViT-B/14), SALAD's aggregation twice as long, a linear layer; 8448 numbers.

    Pictures are made square, in floats, bilinear with a filter as wide as it must be; RGB,
    ImageNet's mean and deviation. With ``resolution=0`` they keep their own size, as the authors'
    network takes them: each side goes to the nearest multiple of 14, within 126 to 1022.

    References
    ----------
    Berton, Masone: MegaLoc: One Retrieval to Place Them All, CVPR Workshops 2025; the authors'
    released weights.
    """

    name: ClassVar[str] = "megaloc"
    summary: ClassVar[str] = "DINOv2 trained on streets, landmarks and rooms alike; heavy"
    citation: ClassVar[str] = (
        "Berton, Masone: MegaLoc: One Retrieval to Place Them All, CVPR Workshops 2025"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: MegaLocParameters | None = None) -> None:
        super().__init__(parameters or MegaLocParameters())
        self.layout = Layout("global", {"descriptor": ArraySpec((DESCRIPTOR_LENGTH,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture at sides that are multiples of 14, RGB, normalised."""
        side = self.parameters.resolution
        height, width = (side, side) if side else map(_nearest, image.shape[:2])
        return imagenet_normalised(resized_float(image, height, width, "bilinear"))

    def batch_size(self) -> int:
        """Return how many pictures run at once: one, where each may have its own size."""
        return super().batch_size() if self.parameters.resolution else 1

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with the official checkpoint's weights."""
        from retraverse.techniques.networks.published import unfilled
        from retraverse.techniques.networks.salad import MegaLocNet

        network = unfilled(MegaLocNet)
        network.load_named(tensors)
        return network


def _nearest(side: int) -> int:
    """Return the multiple of 14 nearest to a side, within what the network takes."""
    return min(max(round(side / PATCH) * PATCH, LEAST_SIDE), LARGEST_SIDE)
