"""CosPlace: places told apart as classes, over millions of street views."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from retraverse.errors import ConfigError
from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.published_input import imagenet_normalised, resized_8_bit
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray
from retraverse.weights.published import COSPLACE_DIMENSIONS
from retraverse.weights.store import find_weights

if TYPE_CHECKING:
    import torch

__all__ = ["CosPlace", "CosPlaceParameters", "GeoParameters", "check_released"]

RELEASE = "release"
LEAST_SIDE, LARGEST_SIDE = 32, 4096


@dataclass(frozen=True)
class GeoParameters(LearnedParameters):
    """What CosPlace and EigenPlaces share."""

    weights: str = parameter(
        RELEASE,
        "release = the authors' for this backbone and dimension; or a stored name, or a file",
        compared=False,
    )
    resolution: int = parameter(
        0, "side in pixels of the square picture, 32 to 4096 (trained at 512); 0 = as it is"
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.resolution:
            check_range("resolution", self.resolution, LEAST_SIDE, LARGEST_SIDE)
        elif self.runtime == "onnx":
            raise ConfigError(
                "resolution: got 0, pictures as they are; expected a size such as 512 with "
                "runtime=onnx, whose graph is of one size"
            )


@dataclass(frozen=True)
class CosPlaceParameters(GeoParameters):
    """Which of the released networks."""

    backbone: Literal["VGG16", "ResNet18", "ResNet50", "ResNet101", "ResNet152"] = parameter(
        "ResNet50", "the network before the pooling"
    )
    dimension: int = parameter(
        512, "length of the descriptor: 32 to 2048, powers of 2 (64 to 512 for VGG16)"
    )

    def __post_init__(self) -> None:
        """Check that there is such a network."""
        super().__post_init__()
        check_released(self, "cosplace", COSPLACE_DIMENSIONS[self.backbone])


def check_released(parameters: GeoParameters, name: str, dimensions: tuple[int, ...]) -> None:
    """Refuse a length that was not released, unless the weights are the user's own."""
    backbone, dimension = parameters.backbone, parameters.dimension  # type: ignore[attr-defined]
    check_range(f"{name} dimension", dimension, 1, 65536)
    if parameters.weights == RELEASE and dimension not in dimensions:
        raise ConfigError(
            f"{name} dimension: got {dimension}, expected one of "
            f"{', '.join(map(str, dimensions))} for {backbone}"
        )


@register(CosPlaceParameters)
class CosPlace(LearnedTechnique):
    """A backbone, generalised mean pooling and a linear layer; cosine of unit vectors.

    Pictures are taken at their own size, as in the authors' evaluation, unless `resolution` says
    otherwise; RGB, ImageNet's mean and deviation.

    References
    ----------
    Berton, Masone, Caputo: Rethinking Visual Geo-localization for Large-Scale Applications,
    CVPR 2022, section 4; the authors' released weights.
    """

    name: ClassVar[str] = "cosplace"
    summary: ClassVar[str] = "trained to tell places of a city apart; 30 sizes to choose from"
    citation: ClassVar[str] = (
        "Berton, Masone, Caputo: Rethinking Visual Geo-localization for Large-Scale Applications, "
        "CVPR 2022"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: GeoParameters | None = None) -> None:
        super().__init__(parameters or CosPlaceParameters())
        shape = (self.parameters.dimension,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture as it is, or square; RGB, normalised."""
        side = self.parameters.resolution
        if side:
            image = resized_8_bit(image, side, side, "bilinear")
        return imagenet_normalised(image)

    def batch_size(self) -> int:
        """Return how many pictures run at once: one, where each may have its own size."""
        return super().batch_size() if self.parameters.resolution else 1

    def weights_path(self) -> Path:
        """Return the file of the released weights of this size, or of the user's own.

        Raises
        ------
        DataMissingError
            If it is not there; says what to run.
        """
        if self.parameters.weights != RELEASE:
            return super().weights_path()
        backbone, dimension = self.parameters.backbone.lower(), self.parameters.dimension
        return find_weights(f"{self.name}-{backbone}-{dimension}")

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with an official checkpoint's weights."""
        from retraverse.techniques.networks.cosplace import CosPlaceNet
        from retraverse.techniques.networks.published import unfilled

        network = unfilled(lambda: CosPlaceNet(self.parameters.backbone, self.parameters.dimension))
        network.load_named(tensors, self.name)
        return network
