"""ORB: binary descriptors of corners, matched one to one; no corners is an answer."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from retraverse import kernels
from retraverse.images import Frame, GreyPath
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.registry import register
from retraverse.types import FloatArray, ImageArray

__all__ = ["Orb", "OrbParameters"]

_BYTES = 32
_PATCH = 31
"""Side in pixels of the patch a descriptor is made from; no keypoint lies nearer to the border."""


@dataclass(frozen=True)
class OrbParameters:
    """How many keypoints a picture has at most, and when two of them match."""

    resolution: int = parameter(
        0, "side of the square picture in pixels, 16 to 1024; 0 = the picture as it is"
    )
    n_features: int = parameter(500, "keypoints of a picture at most, 1 to 10000")
    max_distance: int = parameter(
        50, "bits of 256 in which the keypoints of a good match differ at most, 0 to 256"
    )
    grey: GreyPath = parameter(
        "from_colour", "how grey is made: by the picture's decoder, or from decoded colour"
    )

    def __post_init__(self) -> None:
        """Check every range."""
        if self.resolution:
            check_range("resolution", self.resolution, 16, 1024)
        check_range("n_features", self.n_features, 1, 10_000)
        check_range("max_distance", self.max_distance, 0, 256)


@register(OrbParameters)
class Orb:
    """Oriented FAST corners with rotated BRIEF descriptors, cross-checked.

    Similarity is the number of good matches over the number of the *query's* keypoints: the
    share of the query that is found again. A good match is a pair of keypoints that are each
    other's nearest in Hamming distance (of equals the first), at most `max_distance` bits apart.
    Where either picture has no keypoint it is 0: pictures under some 64 px have none, and on a
    map the answer to a query without any is "no match".

    A description holds `n_features` slots of 32 bytes, of which the first `n_keypoints` are
    taken, in OpenCV's order; the rest is zeros.

    Notes
    -----
    Detection is OpenCV's with its defaults, which are the paper's: 8 levels a factor 1.2 apart,
    patches of 31 px, the corners of the strongest Harris response. Neither the paper nor the
    thesis says which match is good: 50 bits are the strict limit of ORB-SLAM. At 256, where every
    mutually nearest pair counts, any two textured pictures match a quarter of their keypoints.

    References
    ----------
    Rublee, Rabaud, Konolige, Bradski: ORB: an efficient alternative to SIFT or SURF, ICCV 2011;
    Mur-Artal, Montiel, Tardos: ORB-SLAM: a Versatile and Accurate Monocular SLAM System, T-RO
    2015 (the limit of 50); chapter 7 of the thesis.
    """

    name: ClassVar[str] = "orb"
    summary: ClassVar[str] = "matched corners: bears rotation and shift, none in tiny pictures"
    citation: ClassVar[str] = (
        "Rublee, Rabaud, Konolige, Bradski: ORB: an efficient alternative to SIFT or SURF, "
        "ICCV 2011"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: OrbParameters | None = None) -> None:
        self.parameters = parameters or OrbParameters()
        arrays = {
            "descriptor": ArraySpec((self.parameters.n_features, _BYTES), "uint8"),
            "n_keypoints": ArraySpec((), "int32"),
        }
        self.layout = Layout("regional", arrays)

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture in grey, by the path the parameters name."""
        return frame.grey(self.parameters.grey)

    def describe(self, image: ImageArray) -> Description:
        """Return the keypoints' descriptors, and how many there are."""
        found = self._detect(self._resize(image))
        slots = np.zeros((self.parameters.n_features, _BYTES), np.uint8)
        slots[: len(found)] = found
        return {"descriptor": slots, "n_keypoints": np.array(len(found), np.int32)}

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R) in [0, 1]: good matches over the query's keypoints."""
        counts = queries.arrays["n_keypoints"]
        matches = kernels.keypoint_matches(
            queries.descriptor,
            counts,
            references.descriptor,
            references.arrays["n_keypoints"],
            max_distance=self.parameters.max_distance,
        )
        share = matches / np.maximum(counts, 1)[:, np.newaxis]
        return np.asarray(share, dtype=np.float32)

    def _resize(self, image: ImageArray) -> ImageArray:
        size = self.parameters.resolution
        if not size:
            return image
        from PIL import Image

        return np.asarray(Image.fromarray(image).resize((size, size)))

    def _detect(self, grey: ImageArray) -> ImageArray:
        """Return the descriptors, uint8 (n, 32), n from 0 to `n_features`."""
        # OpenCV finds nothing in smaller pictures, and raises on the smallest.
        if min(grey.shape) <= 2 * _PATCH:
            return np.zeros((0, _BYTES), np.uint8)
        import cv2

        # Made anew for every picture: OpenCV does not promise that one may serve two threads.
        detector = cv2.ORB.create(self.parameters.n_features)
        keypoints, descriptors = detector.detectAndCompute(grey, None)
        if descriptors is None:
            return np.zeros((0, _BYTES), np.uint8)
        return np.asarray(descriptors[_strongest(keypoints, self.parameters.n_features)])


def _strongest(keypoints: Any, n_features: int) -> list[int]:
    """Return the places of the strongest keypoints, in order: OpenCV keeps all that tie."""
    by_response = sorted(range(len(keypoints)), key=lambda i: -keypoints[i].response)
    return sorted(by_response[:n_features])
