"""CALC: an encoder that learned to see a picture's HOG through other viewpoints and light."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.networks.caffe_tables import CALC, graph_of, output_shape
from retraverse.techniques.parameters import parameter
from retraverse.techniques.preparing.caffe_input import cubic, equalised
from retraverse.techniques.registry import register
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["Calc", "CalcParameters"]

_INPUT = (1, 120, 160)


@dataclass(frozen=True)
class CalcParameters(LearnedParameters):
    """Which weights."""

    weights: str = parameter(
        "calc", "name of stored weights, or the path of a .caffemodel", compared=False
    )


@register(CalcParameters)
class Calc(LearnedTechnique):
    """CALC's encoder on 160 x 120 grey pixels: 4 maps of 19 x 14, one unit vector of 1064.

    The luminance is equalised, then the picture made grey and small (cubic), 0..1.

    References
    ----------
    Merrill, Huang: Lightweight Unsupervised Deep Loop Closure, RSS 2018, section IV and table I.
    """

    name: ClassVar[str] = "calc"
    summary: ClassVar[str] = "CALC: a small encoder taught HOG of other views; 1064 numbers"
    citation: ClassVar[str] = "Merrill, Huang: Lightweight Unsupervised Deep Loop Closure, RSS 2018"
    version: ClassVar[int] = 1

    def __init__(self, parameters: CalcParameters | None = None) -> None:
        super().__init__(parameters or CalcParameters())
        length = int(np.prod(output_shape(CALC, _INPUT)))
        self.layout = Layout("global", {"descriptor": ArraySpec((length,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return (1, 120, 160) grey pixels, 0..1."""
        import cv2

        grey = np.asarray(cv2.cvtColor(equalised(image), cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        _, height, width = _INPUT
        return cubic(grey, height, width)[np.newaxis].astype(np.float32) / np.float32(255)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the encoder; a file that holds the decoder too will do."""
        from retraverse.techniques.networks.caffe_net import CaffeNet

        return CaffeNet(graph_of(CALC, _INPUT, "CALC"), tensors)
