"""Why JPEG hurts a technique: pictures with one part of JPEG's damage, and what it costs.

Both drives are made worse by the same part, as in chapter 5's uniform compression, and matched by
the technique as it is. A part's *cost* is the change of accuracy against the clean drives, window
by window, with a paired bootstrap interval.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from retraverse.datasets import GroundTruth
from retraverse.errors import InputError
from retraverse.images import Frame, Traverse
from retraverse.images.jpeg import check_compression
from retraverse.images.jpeg_parts import JPEG_PARTS, JpegPart, compress
from retraverse.maps.describe import describe_traverse
from retraverse.matching import match_similarity
from retraverse.metrics import Interval, bootstrap_interval
from retraverse.metrics.checks import Float64Array
from retraverse.techniques import Descriptions, Technique
from retraverse.types import FloatArray, ImageArray, Progress, no_progress

__all__ = ["ABLATED_PARTS", "AblationPoint", "ablate"]

BLOCK_LENGTH = 10
"""Neighbouring windows the bootstrap draws together."""


@dataclass(frozen=True)
class AblationPoint:
    """What one part costs one technique at one sequence length."""

    part: str
    technique: str
    sequence_length: int
    accuracy: float
    change: float
    """Accuracy minus that of the clean drives."""
    interval: Interval
    """95 % of `change`, paired by window, circular blocks of neighbouring windows."""
    correct: Float64Array
    """Whether each window found its place, (W,)."""


ABLATED_PARTS: tuple[JpegPart, ...] = (
    JpegPart("clean", "nothing", lambda picture, _: picture),
    JpegPart("jpeg", "all of JPEG at this c", compress),
    *JPEG_PARTS.values(),
)
"""Every part, the clean picture first."""


def ablate(
    query: Sequence[ImageArray],
    reference: Sequence[ImageArray],
    truth: GroundTruth,
    techniques: Mapping[str, Technique],
    *,
    compression: int = 97,
    sequence_lengths: Sequence[int] = (1, 10),
    chosen: Iterable[JpegPart] = ABLATED_PARTS,
    progress: Progress = no_progress,
) -> list[AblationPoint]:
    """Return what every part of JPEG costs techniques on one pair of drives.

    Parameters
    ----------
    query, reference : sequence of uint8 pictures
        Grey or RGB, as `retraverse.images.native_pixels` gives them.
    truth : GroundTruth
    techniques : mapping of name to Technique
        Each picture is made worse once for all of them.
    compression : int in [0, 99]
        The c whose steps and grid are taken.
    sequence_lengths : sequence of int
    chosen : iterable of JpegPart
        Changes are against the clean drives whether these are chosen or not.
    progress : Progress
        Called with the parts.

    Returns
    -------
    points : list of AblationPoint
        For each part each technique, for each technique each sequence length.

    Raises
    ------
    InputError
        If the truth is of other drives.
    ConfigError
        If c is outside its range.
    """
    if truth.n_queries != len(query):
        raise InputError(f"truth: got {truth.n_queries} queries, expected {len(query)}")
    check_compression(compression)

    def correct(part: JpegPart) -> dict[tuple[str, int], Float64Array]:
        worse = [[part.apply(one, compression) for one in drive] for drive in (query, reference)]
        found = {}
        for name, technique in techniques.items():
            scores = technique.similarity(*(_describe(drive, technique) for drive in worse))
            for length in sequence_lengths:
                found[name, length] = _correct(scores, truth, length)
        return found

    clean = correct(ABLATED_PARTS[0])
    listed = list(chosen)
    points = []
    for part in progress(listed, total=len(listed), label="parts of JPEG"):
        found = clean if part is ABLATED_PARTS[0] else correct(part)
        points += [
            _point(part, name, length, hit, clean[name, length])
            for (name, length), hit in found.items()
        ]
    return points


def _describe(pictures: Sequence[ImageArray], technique: Technique) -> Descriptions:
    frames = tuple(Frame.from_array(picture, index=i) for i, picture in enumerate(pictures))
    drive = Traverse("pictures", "pictures in memory", frames)
    return Descriptions.stack(describe_traverse(drive, technique, threads=1), technique.layout)


def _correct(scores: FloatArray, truth: GroundTruth, length: int) -> Float64Array:
    matches = match_similarity(scores, sequence_length=length)
    return truth.is_correct(matches.query, matches.reference).astype(np.float64)


def _point(
    part: JpegPart, technique: str, length: int, found: Float64Array, clean: Float64Array
) -> AblationPoint:
    change = found - clean
    interval = bootstrap_interval(change, block_length=min(BLOCK_LENGTH, len(change)))
    return AblationPoint(
        part.name, technique, length, float(found.mean()), float(change.mean()), interval, found
    )
