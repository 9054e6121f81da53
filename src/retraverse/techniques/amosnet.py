"""AMOSNet: AlexNet trained from scratch to tell 2,543 places of webcams apart."""

from dataclasses import dataclass
from typing import ClassVar

from retraverse.techniques.parameters import parameter
from retraverse.techniques.registry import register
from retraverse.techniques.sped_technique import SpedParameters, SpedTechnique

__all__ = ["AmosNet", "AmosNetParameters"]


@dataclass(frozen=True)
class AmosNetParameters(SpedParameters):
    """Which weights, and which mean image."""

    weights: str = parameter(
        "amosnet", "name of stored weights, or the path of a .caffemodel", compared=False
    )


@register(AmosNetParameters)
class AmosNet(SpedTechnique):
    """Conv5 of AMOSNet after its ReLU, 30 spatial maxima of each map.

    References
    ----------
    Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at Scale
    for Visual Place Recognition, ICRA 2017, sections III and IV.
    """

    name: ClassVar[str] = "amosnet"
    summary: ClassVar[str] = "AMOSNet: AlexNet trained on webcams through the seasons"
    citation: ClassVar[str] = (
        "Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at "
        "Scale for Visual Place Recognition, ICRA 2017"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: AmosNetParameters | None = None) -> None:
        super().__init__(parameters or AmosNetParameters())
