"""MixVPR: every place of a ResNet's maps hears of every other."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import parameter
from retraverse.techniques.preparing.published_input import imagenet_normalised, resized_8_bit
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray
from retraverse.weights.store import find_weights

if TYPE_CHECKING:
    import torch

__all__ = ["MixVpr", "MixVprParameters"]

_RELEASE = "release"
_SIDE = 320
_SHAPES = {128: (64, 2), 512: (256, 2), 4096: (1024, 4)}
"""Length of the descriptor -> channels and rows."""


@dataclass(frozen=True)
class MixVprParameters(LearnedParameters):
    """Which of the released networks."""

    weights: str = parameter(
        _RELEASE,
        "release = the authors' for this dimension; or a stored name, or a file",
        compared=False,
    )
    dimension: Literal[4096, 512, 128] = parameter(4096, "length of the descriptor")


@register(MixVprParameters)
class MixVpr(LearnedTechnique):
    """ResNet50 to its third stage, four feature mixers, two projections; cosine of unit vectors.

    Pictures are made 320 x 320 (Pillow, bicubic), RGB, ImageNet's mean and deviation.

    References
    ----------
    Ali-bey, Chaib-draa, Giguère: MixVPR: Feature Mixing for Visual Place Recognition, WACV 2023;
    the authors' released weights.
    """

    name: ClassVar[str] = "mixvpr"
    summary: ClassVar[str] = "ResNet50 with feature mixing: strong, and half a ResNet's cost"
    citation: ClassVar[str] = (
        "Ali-bey, Chaib-draa, Giguère: MixVPR: Feature Mixing for Visual Place Recognition, "
        "WACV 2023"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: MixVprParameters | None = None) -> None:
        super().__init__(parameters or MixVprParameters())
        shape = (self.parameters.dimension,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture at 320 x 320, RGB, normalised."""
        return imagenet_normalised(resized_8_bit(image, _SIDE, _SIDE, "bicubic"))

    def weights_path(self) -> Path:
        """Return the file of the released weights of this length, or of the user's own.

        Raises
        ------
        DataMissingError
            If it is not there; says what to run.
        """
        if self.parameters.weights != _RELEASE:
            return super().weights_path()
        return find_weights(f"mixvpr-{self.parameters.dimension}")

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network with an official checkpoint's weights."""
        from retraverse.techniques.networks.mixvpr import MixVprNet
        from retraverse.techniques.networks.published import unfilled

        network = unfilled(lambda: MixVprNet(*_SHAPES[self.parameters.dimension]))
        network.load_named(tensors)
        return network
