"""What a comparison puts on record about what it was made by."""

import hashlib

import numpy as np
from tests.unit.matching.streets import street

import retraverse as rt
from retraverse.studies.comparison import ComparePlan, compare
from retraverse.studies.comparison_record import Provenance
from retraverse.techniques import ArraySpec, Description, Layout, Technique
from retraverse.types import ImageArray


class Learned:
    """HOG by another name, with numbers that stand for trained weights."""

    def __init__(self, weights: bytes) -> None:
        self._hog = rt.technique("hog", resolution=64)
        self._weights = weights
        self.name, self.summary, self.citation = "learned", "for tests", "none"
        self.version, self.parameters = 1, self._hog.parameters
        self.layout = Layout("global", {"descriptor": ArraySpec((4,), "float32")})
        self.read, self.similarity = self._hog.read, self._hog.similarity

    def describe(self, image: ImageArray) -> Description:
        quarters = np.array_split(np.asarray(image, np.float32), 4, axis=1)
        return {"descriptor": np.array([part.mean() for part in quarters], np.float32)}

    def fingerprint(self) -> str:
        return hashlib.sha256(self._weights).hexdigest()


def provenance(technique: Technique) -> Provenance:
    drive = rt.open_traverse(street(5))
    return compare(drive, drive, ComparePlan(technique, sequence_length=2)).provenance


def test_trained_weights_are_told_apart_by_their_content() -> None:
    for weights in (b"one", b"two"):
        recorded = provenance(Learned(weights))  # type: ignore[arg-type]
        assert recorded.weights == hashlib.sha256(weights).hexdigest()


def test_a_technique_without_weights_has_none_on_record() -> None:
    assert provenance(rt.technique("hog", resolution=64)).weights == ""
