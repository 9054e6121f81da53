"""CoHOG: regional HOG of single frames, matched by the best region anywhere."""

from typing import ClassVar

from retraverse.techniques.handmade.regional_hog import RegionalHog, RegionalHogParameters
from retraverse.techniques.registry import register

__all__ = ["CoHog"]


@register(RegionalHogParameters)
class CoHog(RegionalHog):
    """Regional HOG with entropy regions of interest, one frame at a time.

    References
    ----------
    Zaffar, Ehsan, Milford, McDonald-Maier: CoHOG: A Light-Weight, Compute-Efficient, and
    Training-Free Visual Place Recognition Technique for Changing Environments, RA-L 2020.
    """

    name: ClassVar[str] = "cohog"
    summary: ClassVar[str] = "regional HOG, best region anywhere: bears moderate viewpoint change"
    citation: ClassVar[str] = (
        "Zaffar, Ehsan, Milford, McDonald-Maier: CoHOG: A Light-Weight, Compute-Efficient, and "
        "Training-Free Visual Place Recognition Technique for Changing Environments, RA-L 2020"
    )

    def __init__(self, parameters: RegionalHogParameters | None = None) -> None:
        super().__init__(parameters or RegionalHogParameters())
