"""ConvSequential-SLAM: regional HOG for sequences whose length adapts to the surroundings."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from retraverse.errors import ConfigError
from retraverse.images import GreyPath
from retraverse.techniques.handmade.regional_hog import RegionalHog, RegionalHogParameters
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.registry import register

__all__ = ["ConvSequential", "ConvSequentialParameters"]


@dataclass(frozen=True)
class ConvSequentialParameters(RegionalHogParameters):
    """Regional HOG, whose ROI a window takes, and when a window grows (section 3.3.3)."""

    grey: GreyPath = parameter(
        "decoder", "how grey is made: by the picture's decoder, or from decoded colour"
    )
    roi: Literal["first", "each"] = parameter(
        "first", "ROI of a window's first frame for all its pairs (authors' program), or each own"
    )
    sequence_entropy: float = parameter(
        0.5, "a window grows while its mean picture entropy is at most this (ET), 0 to 1"
    )
    information_threshold: float = parameter(
        0.9, "a window grows while its newest frame is at least this similar to its first (IT)"
    )
    min_sequence_length: int = parameter(1, "min_K: at least so many frames are read")
    max_overlap_length: int = parameter(15, "max_K_IG: similarity alone grows no further")
    max_sequence_length: int = parameter(25, "max_K: no window is longer")

    def __post_init__(self) -> None:
        """Check every range and that the three lengths are in order."""
        super().__post_init__()
        check_range("sequence_entropy", self.sequence_entropy, 0.0, 1.0)
        check_range("information_threshold", self.information_threshold, 0.0, 1.0)
        lengths = (self.min_sequence_length, self.max_overlap_length, self.max_sequence_length)
        if not 1 <= lengths[0] <= lengths[1] <= lengths[2]:
            raise ConfigError(
                "min_sequence_length, max_overlap_length, max_sequence_length: got "
                f"{lengths[0]}, {lengths[1]}, {lengths[2]}, expected 1 or more and rising"
            )


@register(ConvSequentialParameters)
class ConvSequential(RegionalHog):
    """Regional HOG with the parameters that `retraverse.matching` reads for dynamic windows.

    References
    ----------
    Tomita, Zaffar, Milford, McDonald-Maier, Ehsan: ConvSequential-SLAM: A Sequence-Based,
    Training-Less Visual Place Recognition Technique for Changing Environments, IEEE Access 2021;
    chapter 3 of the thesis.
    """

    name: ClassVar[str] = "convsequential"
    summary: ClassVar[str] = "regional HOG for sequences of fixed or self-chosen length"
    citation: ClassVar[str] = (
        "Tomita, Zaffar, Milford, McDonald-Maier, Ehsan: ConvSequential-SLAM: A Sequence-Based, "
        "Training-Less Visual Place Recognition Technique for Changing Environments, "
        "IEEE Access 2021"
    )

    parameters: ConvSequentialParameters

    def __init__(self, parameters: ConvSequentialParameters | None = None) -> None:
        super().__init__(parameters or ConvSequentialParameters())
