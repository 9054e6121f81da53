"""HybridNet: AlexNet of ImageNet, trained on to tell 2,543 places of webcams apart."""

from dataclasses import dataclass
from typing import ClassVar

from retraverse.techniques.parameters import parameter
from retraverse.techniques.registry import register
from retraverse.techniques.sped_technique import SpedParameters, SpedTechnique

__all__ = ["HybridNet", "HybridNetParameters"]


@dataclass(frozen=True)
class HybridNetParameters(SpedParameters):
    """Which weights, and which mean image."""

    weights: str = parameter(
        "hybridnet", "name of stored weights, or the path of a .caffemodel", compared=False
    )


@register(HybridNetParameters)
class HybridNet(SpedTechnique):
    """Conv5 of HybridNet after its ReLU, 30 spatial maxima of each map.

    References
    ----------
    Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at Scale
    for Visual Place Recognition, ICRA 2017, sections III and IV.
    """

    name: ClassVar[str] = "hybridnet"
    summary: ClassVar[str] = (
        "HybridNet: ImageNet's AlexNet, trained on with webcams through the seasons"
    )
    citation: ClassVar[str] = (
        "Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at "
        "Scale for Visual Place Recognition, ICRA 2017"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: HybridNetParameters | None = None) -> None:
        super().__init__(parameters or HybridNetParameters())
