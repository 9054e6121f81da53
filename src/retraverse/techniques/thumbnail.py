"""Thumbnails: pictures made tiny and compared pixel by pixel, plain or patch-normalised."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from retraverse import kernels
from retraverse.errors import ConfigError
from retraverse.images import Frame, GreyPath
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.registry import register
from retraverse.types import BoolArray, FloatArray, ImageArray

__all__ = ["PatchNorm", "PatchNormParameters", "Sad", "SadParameters", "patch_normalised"]

PAPER_SIZE = (32, 64)
"""Height and width in pixels of SeqSLAM's thumbnails."""
_WHITE = 255


@dataclass(frozen=True)
class SadParameters:
    """Size of the thumbnails, and how two are compared."""

    resolution: int = parameter(
        0, "side of the square thumbnail in pixels, 8 to 1024; 0 = 64 wide and 32 high (SeqSLAM)"
    )
    difference: Literal["absolute", "saturating"] = parameter(
        "absolute", "|query - reference| per pixel, or max(query - reference, 0) (OpenSeqSLAM)"
    )
    grey: GreyPath = parameter(
        "from_colour", "how grey is made: by the picture's decoder, or from decoded colour"
    )

    def __post_init__(self) -> None:
        """Check the range of the size."""
        if self.resolution:
            check_range("resolution", self.resolution, 8, 1024)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of a thumbnail in pixels."""
        return (self.resolution, self.resolution) if self.resolution else PAPER_SIZE


@dataclass(frozen=True)
class PatchNormParameters(SadParameters):
    """As plain thumbnails, and the patches they are normalised by."""

    patch: int = parameter(8, "side in pixels of the square patches that are normalised, 2 to 64")

    def __post_init__(self) -> None:
        """Check the ranges, and that patches tile the thumbnail."""
        super().__post_init__()
        check_range("patch", self.patch, 2, 64)
        height, width = self.size
        if height % self.patch or width % self.patch:
            raise ConfigError(
                f"patch: got {self.patch}, expected a divisor of the thumbnail's {width} x {height}"
            )


class _Thumbnails:
    """What both kinds share: a small grey picture, and the summed difference of two."""

    version: ClassVar[int] = 1

    def __init__(self, parameters: SadParameters, span: int) -> None:
        height, width = parameters.size
        self._parameters = parameters
        self._largest_sum = height * width * span
        self.layout = Layout("global", {"descriptor": ArraySpec((height * width,), "uint8")})

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in grey, by the path the parameters name."""
        return frame.grey(self._parameters.grey)

    def differences(self, queries: Descriptions, references: Descriptions) -> NDArray[np.uint32]:
        """Return the summed pixel differences, uint32 (Q, R): SeqSLAM's difference matrix.

        A distance: lower is more alike. OpenSeqSLAM also divides it by the number of references.
        """
        return kernels.thumbnail_differences(
            queries.descriptor, references.descriptor, difference=self._parameters.difference
        )

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R) in [0, 1]: 1 less the mean difference over the largest possible.

        With P pixels that differ by at most `span` (255 for plain thumbnails, 16 for patches of
        8 x 8), ``similarity = 1 - D / (P * span)``, D as of `differences`. D is a whole number,
        so for P * span up to 4 million ``round((1 - similarity) * P * span)`` gives it back
        exactly. A picture without contrast has no descriptor; its similarity with anything is 0.
        """
        sums = self.differences(queries, references).astype(np.float32)
        scores: FloatArray = 1 - sums / np.float32(self._largest_sum)
        scores[_is_empty(queries)] = 0
        scores[:, _is_empty(references)] = 0
        return scores

    def _shrink(self, image: ImageArray) -> ImageArray:
        """Return the thumbnail: Lanczos to the paper's size, else Pillow's default filter."""
        from PIL import Image

        height, width = self._parameters.size
        how = None if self._parameters.resolution else Image.Resampling.LANCZOS
        return np.asarray(Image.fromarray(image).resize((width, height), how))


@register(SadParameters)
class Sad(_Thumbnails):
    """Plain thumbnails compared by their sum of absolute differences.

    A descriptor is the thumbnail's grey levels row by row; a picture whose thumbnail is one flat
    grey is all zeros, that is no descriptor.

    References
    ----------
    Milford, Wyeth: SeqSLAM: Visual Route-Based Navigation for Sunny Summer Days and Stormy
    Winter Nights, ICRA 2012, equation 3, without the normalisation before it.
    """

    name: ClassVar[str] = "sad"
    summary: ClassVar[str] = "tiny pictures compared pixel by pixel: wants the same light"
    citation: ClassVar[str] = (
        "Milford, Wyeth: SeqSLAM: Visual Route-Based Navigation for Sunny Summer Days and Stormy "
        "Winter Nights, ICRA 2012"
    )

    def __init__(self, parameters: SadParameters | None = None) -> None:
        self.parameters = parameters or SadParameters()
        super().__init__(self.parameters, span=_WHITE)

    def describe(self, image: ImageArray) -> Description:
        """Return the thumbnail's pixels, or zeros where all are alike."""
        thumbnail = self._shrink(image)
        has_contrast = np.ptp(thumbnail) > 0
        return {"descriptor": thumbnail.ravel() * np.uint8(has_contrast)}


@register(PatchNormParameters)
class PatchNorm(_Thumbnails):
    """SeqSLAM's thumbnails: every patch brought to the same brightness and contrast.

    Notes
    -----
    The original program resizes with MATLAB's lanczos3, which no other library repeats to the
    grey level: given 64 x 32 pictures, nothing is resized, and descriptors are its own.
    It divides 0 by 0 in a patch without contrast; here such a patch is 127, and a picture without
    any other patch is all zeros, that is no descriptor.

    References
    ----------
    Milford, Wyeth: SeqSLAM: Visual Route-Based Navigation for Sunny Summer Days and Stormy
    Winter Nights, ICRA 2012, section III; parameters of the authors' OpenSeqSLAM (64 x 32,
    patches of 8 x 8).
    """

    name: ClassVar[str] = "patchnorm"
    summary: ClassVar[str] = "SeqSLAM's thumbnails: tiny pictures with evened-out light"
    citation: ClassVar[str] = Sad.citation

    def __init__(self, parameters: PatchNormParameters | None = None) -> None:
        self.parameters = parameters or PatchNormParameters()
        super().__init__(self.parameters, span=2 * largest_deviation(self.parameters.patch))

    def describe(self, image: ImageArray) -> Description:
        """Return the normalised thumbnail's pixels, or zeros where no patch has contrast."""
        normalised = patch_normalised(self._shrink(image), self.parameters.patch)
        has_contrast = np.ptp(normalised) > 0
        return {"descriptor": normalised.ravel() * np.uint8(has_contrast)}


def patch_normalised(grey: ImageArray, patch: int = 8) -> ImageArray:
    """Return 127 + (pixel - mean) / std, rounded, of each patch of its own.

    Parameters
    ----------
    grey : uint8 array, shape (H, W)
        Both sides multiples of `patch`.
    patch : int, at least 2
        Side of a patch in pixels.

    Returns
    -------
    normalised : uint8 array, shape (H, W)
        127 where a patch has no contrast. Halves are rounded away from 127; the standard
        deviation is that of a sample (divided by n - 1).
    """
    height, width = grey.shape
    patches = grey.reshape(height // patch, patch, width // patch, patch).astype(np.float64)
    centred = patches - patches.mean(axis=(1, 3), keepdims=True)
    variance = np.square(centred).sum(axis=(1, 3), keepdims=True) / (patch * patch - 1)
    deviation = centred / np.sqrt(np.where(variance > 0, variance, 1))
    rounded = np.copysign(np.floor(np.abs(deviation) + 0.5), deviation)
    return np.asarray((127 + rounded).reshape(height, width), dtype=np.uint8)


def largest_deviation(patch: int) -> int:
    """Return the largest rounded (pixel - mean) / std of a patch: one pixel unlike all others."""
    n_pixels = patch * patch
    return int((n_pixels - 1) / np.sqrt(n_pixels) + 0.5)


def _is_empty(descriptions: Descriptions) -> BoolArray:
    return ~np.asarray(descriptions.descriptor.any(axis=1))
