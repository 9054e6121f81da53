"""EigenPlaces: CosPlace's network, trained on views of one spot from many sides."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from retraverse.techniques.cosplace import CosPlace, GeoParameters, check_released
from retraverse.techniques.parameters import parameter
from retraverse.techniques.registry import register
from retraverse.weights.published import EIGENPLACES_DIMENSIONS

__all__ = ["EigenPlaces", "EigenPlacesParameters"]


@dataclass(frozen=True)
class EigenPlacesParameters(GeoParameters):
    """Which of the released networks."""

    backbone: Literal["VGG16", "ResNet18", "ResNet50", "ResNet101"] = parameter(
        "ResNet50", "the network before the pooling"
    )
    dimension: int = parameter(
        2048, "length of the descriptor: 128 to 2048 (256 or 512 for ResNet18, 512 for VGG16)"
    )

    def __post_init__(self) -> None:
        """Check that there is such a network."""
        super().__post_init__()
        check_released(self, "eigenplaces", EIGENPLACES_DIMENSIONS[self.backbone])


@register(EigenPlacesParameters)
class EigenPlaces(CosPlace):
    """As `CosPlace`, with the weights of EigenPlaces.

    References
    ----------
    Berton, Trivigno, Caputo, Masone: EigenPlaces: Training Viewpoint Robust Models for Visual
    Place Recognition, ICCV 2023; the authors' released weights.
    """

    name: ClassVar[str] = "eigenplaces"
    summary: ClassVar[str] = "CosPlace's network trained for changes of viewpoint"
    citation: ClassVar[str] = (
        "Berton, Trivigno, Caputo, Masone: EigenPlaces: Training Viewpoint Robust Models for "
        "Visual Place Recognition, ICCV 2023"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: EigenPlacesParameters | None = None) -> None:
        super().__init__(parameters or EigenPlacesParameters())
