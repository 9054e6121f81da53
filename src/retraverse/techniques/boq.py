"""BoQ: bags of learned queries over the features of ResNet50 or DINOv2."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_multiple, parameter
from retraverse.techniques.preparing.published_input import imagenet_normalised, resized_float
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray
from retraverse.weights.store import find_weights

if TYPE_CHECKING:
    import torch

__all__ = ["Boq", "BoqParameters"]

_RELEASE = "release"


@dataclass(frozen=True)
class _Form:
    """One released network."""

    dimension: int
    side: int
    step: int
    """The picture's side must be a multiple of this."""


_FORMS = {"resnet50": _Form(16384, 384, 16), "dinov2": _Form(12288, 322, 14)}
_LEAST_STEPS, _MOST_STEPS = 2, 73


@dataclass(frozen=True)
class BoqParameters(LearnedParameters):
    """Which of the two released networks."""

    weights: str = parameter(
        _RELEASE,
        "release = the authors' for this backbone; or a stored name, or a file",
        compared=False,
    )
    backbone: Literal["resnet50", "dinov2"] = parameter(
        "resnet50", "the network before the queries: 16384 numbers, or dinov2 with 12288"
    )
    resolution: int = parameter(
        0,
        "side in pixels of the square picture, a multiple of 16 (resnet50) or 14 (dinov2); "
        "0 = the published 384 or 322",
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.resolution:
            step = _FORMS[self.backbone].step
            low, high = _LEAST_STEPS * step, _MOST_STEPS * step
            check_multiple("boq resolution", self.resolution, step, low, high)


@register(BoqParameters)
class Boq(LearnedTechnique):
    """Features of ResNet50 or DINOv2, asked by two bags of 64 queries; cosine of unit vectors.

    Pictures are made square in floats, bicubic with a filter as wide as it must be; RGB, ImageNet's
    mean and deviation.

    References
    ----------
    Ali-bey, Chaib-draa, Giguère: BoQ: A Place is Worth a Bag of Learnable Queries, CVPR 2024; the
    authors' released weights.
    """

    name: ClassVar[str] = "boq"
    summary: ClassVar[str] = "learned queries over ResNet50 or DINOv2: strong, long descriptors"
    citation: ClassVar[str] = (
        "Ali-bey, Chaib-draa, Giguère: BoQ: A Place is Worth a Bag of Learnable Queries, CVPR 2024"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: BoqParameters | None = None) -> None:
        super().__init__(parameters or BoqParameters())
        self._form = _FORMS[self.parameters.backbone]
        shape = (self._form.dimension,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the square picture, RGB, normalised."""
        side = self.parameters.resolution or self._form.side
        return imagenet_normalised(resized_float(image, side, side, "bicubic"))

    def weights_path(self) -> Path:
        """Return the file of the released weights of this backbone, or of the user's own.

        Raises
        ------
        DataMissingError
            If it is not there; says what to run.
        """
        if self.parameters.weights != _RELEASE:
            return super().weights_path()
        return find_weights(f"boq-{self.parameters.backbone}-{self._form.dimension}")

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with an official checkpoint's weights."""
        from retraverse.techniques.networks.boq import BoqNet
        from retraverse.techniques.networks.published import unfilled

        network = unfilled(lambda: BoqNet(self.parameters.backbone, self._form.dimension))
        network.load_named(tensors)
        return network
