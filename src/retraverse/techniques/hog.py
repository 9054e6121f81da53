"""HOG: one histogram of oriented gradients of the whole picture, in the three forms in use."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError
from retraverse.images import Frame
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.registry import register
from retraverse.techniques.summarising.vectors import cosine_similarity, unit_vector
from retraverse.types import FloatArray, ImageArray

__all__ = ["Hog", "HogParameters"]

Form = Literal["vprbench", "chapter6", "chapter7"]


@dataclass(frozen=True)
class _Geometry:
    """Sizes in pixels of one published form."""

    resolution: int
    block: int
    stride: int
    cell: int
    resize: Literal["opencv", "pillow"]


_FORMS: dict[Form, _Geometry] = {
    "vprbench": _Geometry(resolution=512, block=16, stride=8, cell=16, resize="opencv"),
    "chapter6": _Geometry(resolution=256, block=32, stride=16, cell=16, resize="opencv"),
    "chapter7": _Geometry(resolution=256, block=16, stride=16, cell=16, resize="pillow"),
}
_BINS = 9


@dataclass(frozen=True)
class HogParameters:
    """Which published form, and at what size."""

    form: Form = parameter(
        "vprbench",
        "blocks of 16 px every 8 px (vprbench), of 32 px (chapter6), plain cells (chapter7)",
    )
    resolution: int = parameter(
        0, "side of the square picture in pixels, 16 to 1024; 0 = the form's own (512, 256, 256)"
    )

    def __post_init__(self) -> None:
        """Check the size against the form's blocks."""
        if self.resolution == 0:
            return
        geometry = _FORMS[self.form]
        check_range("hog resolution", self.resolution, 16, 1024)
        if self.resolution % geometry.stride or self.resolution < geometry.block:
            raise ConfigError(
                f"hog resolution: got {self.resolution}, expected a multiple of {geometry.stride} "
                f"of at least {geometry.block} (form {self.form})"
            )


@register(HogParameters)
class Hog:
    """Histogram of oriented gradients over the whole picture.

    Unsigned gradients in 9 bins, L2-Hys blocks clipped at 0.2, no gamma correction, the
    strongest colour channel of each pixel; cosine similarity in [0, 1].

    Notes
    -----
    Without gamma correction the published score matrix of Corridor is met to 5e-7; with it the
    difference is 0.027.

    References
    ----------
    Dalal, Triggs: Histograms of Oriented Gradients for Human Detection, CVPR 2005. The forms
    are those of VPR-Bench (35,721 values), and of chapters 6 (8,100) and 7 of the thesis.
    """

    name: ClassVar[str] = "hog"
    summary: ClassVar[str] = (
        "one gradient histogram of the whole picture: cheap, wants the same viewpoint"
    )
    citation: ClassVar[str] = (
        "Dalal, Triggs: Histograms of Oriented Gradients for Human Detection, CVPR 2005"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: HogParameters | None = None) -> None:
        self.parameters = parameters or HogParameters()
        self._geometry = _FORMS[self.parameters.form]
        self._size = self.parameters.resolution or self._geometry.resolution
        blocks = (self._size - self._geometry.block) // self._geometry.stride + 1
        cells = (self._geometry.block // self._geometry.cell) ** 2
        shape = (blocks * blocks * cells * _BINS,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in colour."""
        return frame.colour()

    def describe(self, image: ImageArray) -> Description:
        """Return the unit vector of block-normalised histograms."""
        resized = _resize(image, self._size, self._geometry.resize)
        return {"descriptor": unit_vector(self._opencv_hog().compute(resized))}

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return the cosine of every pair (equation 4.1)."""
        return cosine_similarity(queries, references, non_negative=True)

    def _opencv_hog(self) -> Any:
        # Made anew for every picture: OpenCV does not promise that one may serve two threads.
        import cv2

        geometry, size = self._geometry, self._size
        return cv2.HOGDescriptor(
            (size, size),
            (geometry.block, geometry.block),
            (geometry.stride, geometry.stride),
            (geometry.cell, geometry.cell),
            _BINS,
        )


def _resize(image: ImageArray, size: int, how: Literal["opencv", "pillow"]) -> ImageArray:
    """Return the picture at size x size: OpenCV bilinear, or Pillow's default filter."""
    if how == "opencv":
        import cv2

        return np.asarray(cv2.resize(image, (size, size)), dtype=np.uint8)
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize((size, size)))
