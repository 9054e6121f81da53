"""GIST: where in the picture there is structure of which scale and direction."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from retraverse.images import Frame, GreyPath
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.handmade.gist_filters import (
    BORDER,
    GRID,
    ORIENTATIONS,
    SCALES,
    Transforms,
    filter_bank,
    normalise_contrast,
)
from retraverse.techniques.parameters import check_multiple, parameter
from retraverse.techniques.registry import register
from retraverse.techniques.summarising.vectors import cosine_similarity, unit_vector
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["Gist", "GistParameters"]

_DIMENSION = SCALES * ORIENTATIONS * GRID * GRID


@dataclass(frozen=True)
class GistParameters:
    """Size of the picture, and how exactly its filters are computed."""

    resolution: int = parameter(
        256, "side of the square picture in pixels, a multiple of 4 from 16 to 1024"
    )
    transforms: Transforms = parameter(
        "cropped", "filter in each filter's band only, several times faster, or in full"
    )
    grey: GreyPath = parameter(
        "from_colour", "how grey is made: by the picture's decoder, or from decoded colour"
    )

    def __post_init__(self) -> None:
        """Check that blocks tile the picture."""
        check_multiple("resolution", self.resolution, GRID, 16, 1024)


@register(GistParameters)
class Gist:
    """The mean strength of 32 oriented band-passes in 4 x 4 blocks: 512 values, a unit vector.

    What is computed, for a grey picture resized to S x S with Pillow's default filter:

    1. Grey levels are stretched to 0..255 (a flat picture has no descriptor: zeros).
    2. Contrast normalisation: x = log(1 + level), mirrored by 5 pixels at each side and taken as
       periodic; d = x - lowpass(x); y = d / (0.2 + sqrt(lowpass(d^2))). The low-pass is
       Gaussian, its gain exp(-k^2 ln 2 / 4^2) at k cycles a (mirrored) picture: a half at 4.
    3. y without those 5 pixels is mirrored by 32 at each side, N = S + 64, and Fourier
       transformed.
    4. Filter (s, o), s = 0..3, o = 0..7, multiplies frequency (fx, fy), in cycles a pixel, by
       exp(-3.5 (f / f0 - 1)^2 - 2 pi angle^2) with f0 = 0.3 / 1.85^s, f = |(fx, fy)|, and angle =
       atan2(fy, fx) + pi o / 8 brought to -pi..pi; atan2(0, 0) = 0.
    5. The magnitude of the (complex) inverse transform, without the 32 pixels, is averaged in 4 x
       4 equal blocks.

    Values come in the order scale, orientation, row of blocks, column, and are divided by
    the vector's length. Cosine similarity, in [0, 1].

    Notes
    -----
    With ``transforms="cropped"`` frequencies far outside a filter's band are left out and the
    magnitude is sampled more coarsely than the pixels: on photographs single values differ from
    the definition by less than 1e-3 (of a vector of length 1) and the cosine of the two vectors
    is above 0.99999; on a checkerboard of single pixels, the worst there is, 4e-3 and 0.9999.
    With ``"full"`` only float32 rounding is left (1e-5). Pictures below 80 px are always
    transformed in full. The filters of a size are made once, when the first picture comes.

    References
    ----------
    Oliva, Torralba: Modeling the Shape of the Scene: A Holistic Representation of the Spatial
    Envelope, IJCV 42(3), 2001; parameters of the descriptor published with it: 8 orientations at
    each of 4 scales, 4 x 4 blocks, normalisation at 4 cycles a picture.
    """

    name: ClassVar[str] = "gist"
    summary: ClassVar[str] = (
        "structure by scale, direction and place: 512 values at any size, best on small pictures"
    )
    citation: ClassVar[str] = (
        "Oliva, Torralba: Modeling the Shape of the Scene: A Holistic Representation of the "
        "Spatial Envelope, IJCV 2001"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: GistParameters | None = None) -> None:
        self.parameters = parameters or GistParameters()
        self.layout = Layout("global", {"descriptor": ArraySpec((_DIMENSION,), "float32")})

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in grey, by the path the parameters name."""
        return frame.grey(self.parameters.grey)

    def describe(self, image: ImageArray) -> Description:
        """Return the unit vector of block means; zeros for a flat picture."""
        stretched = _stretch(self._resize(image))
        if stretched is None:
            return {"descriptor": np.zeros(_DIMENSION, np.float32)}
        low_pass, filters = filter_bank(self.parameters.resolution, self.parameters.transforms)
        spectrum = _centred_spectrum(normalise_contrast(stretched, low_pass))
        means = np.stack([band.block_means(spectrum) for band in filters])
        # Interpolation between samples may undershoot where a block is nearly empty.
        return {"descriptor": unit_vector(np.maximum(means, 0))}

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return the cosine of every pair (equation 4.1)."""
        return cosine_similarity(queries, references, non_negative=True)

    def _resize(self, image: ImageArray) -> ImageArray:
        from PIL import Image

        size = self.parameters.resolution
        return np.asarray(Image.fromarray(image).resize((size, size)))


def _stretch(grey: ImageArray) -> FloatArray | None:
    """Return grey levels stretched to 0..255, or None where all are alike."""
    low, high = int(grey.min()), int(grey.max())
    if low == high:
        return None
    return (grey.astype(np.float32) - np.float32(low)) * np.float32(255 / (high - low))


def _centred_spectrum(picture: FloatArray) -> Array:
    """Return the transform of the mirrored picture, complex64 (N, N), frequency 0 in the middle."""
    import cv2

    mirrored = np.asarray(
        cv2.copyMakeBorder(picture, BORDER, BORDER, BORDER, BORDER, cv2.BORDER_REFLECT)
    )
    # Alternating signs move frequency 0 from the corner to the middle.
    signs = 1 - 2 * (np.arange(len(mirrored), dtype=np.float32) % 2)
    alternating = mirrored * signs * signs[:, np.newaxis]
    spectrum = np.asarray(cv2.dft(alternating, flags=cv2.DFT_COMPLEX_OUTPUT), np.float32)
    return spectrum.view(np.complex64)[..., 0]
