"""What a robot saves by sending strongly compressed pictures of a longer window.

The question: an answer from K clean pictures, or from their descriptors, has some accuracy; how
long a window of compressed pictures reaches the same, and what does it weigh?

Conventions
- Query and map are compressed alike. Clean is the weakest compression of the study: pictures as
  they are where it has them, else c = 0 (quality 100).
- Bytes of an answer that starts from nothing are K pictures or K descriptors (equation 6.1). A
  robot on its way sends only the newest, whatever K is: bytes a frame stand beside.
- Equal accuracy is at least the same share of right windows; the records hold the intervals.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from retraverse.studies.judging.selection import (
    Condition,
    Curve,
    curves_of,
    data_per_answer,
    length_of,
    mean_bytes,
)
from retraverse.studies.keeping.records import RunRecord

__all__ = ["Saving", "savings"]


@dataclass(frozen=True)
class Saving:
    """One clean setting, and the shortest window of compressed pictures that is as good."""

    clean: RunRecord
    compressed: RunRecord | None
    """None if no length of the study is as good."""

    @property
    def clean_bytes(self) -> float:
        """Bytes of an answer from clean pictures."""
        return data_per_answer(self.clean)

    @property
    def descriptor_bytes(self) -> float:
        """Bytes of an answer from descriptors of clean pictures; NaN if unknown."""
        size = self.clean.descriptor_bytes
        return size * self.clean.mean_sequence_length if size >= 0 else math.nan

    @property
    def compressed_bytes(self) -> float:
        """Bytes of an answer from compressed pictures; NaN if none is as good."""
        return math.nan if self.compressed is None else data_per_answer(self.compressed)

    @property
    def frame_bytes(self) -> tuple[float, float, float]:
        """Bytes of one more frame: clean picture, its descriptor, compressed picture."""
        size = self.clean.descriptor_bytes
        return (
            mean_bytes(self.clean),
            float(size) if size >= 0 else math.nan,
            math.nan if self.compressed is None else mean_bytes(self.compressed),
        )


def savings(
    records: Iterable[RunRecord], *, compression: int = 95, lengths: Iterable[int] = (1, 5, 10)
) -> list[Saving]:
    """Return what compression saves, for every technique, dataset and clean length.

    Parameters
    ----------
    records : iterable of RunRecord
        Of a study with several compressions and lengths.
    compression : int
        c of the pictures that are sent.
    lengths : iterable of int
        K of the clean settings that are to be equalled.

    Returns
    -------
    savings : list of Saving
        Sorted by condition, then by length.
    """
    curves = {
        condition: curve for condition, curve in curves_of(records).items() if condition.is_uniform
    }
    found = []
    for condition, curve in curves.items():
        strong = curves.get(_compressed(condition, compression))
        if strong is None or condition.compression_query != _weakest(condition, curves):
            continue
        found += [
            Saving(run, _as_good(strong, run))
            for length in lengths
            for run in curve
            if length_of(run) == length
        ]
    return found


def _compressed(condition: Condition, compression: int) -> Condition:
    return replace(condition, compression_query=compression, compression_reference=compression)


def _weakest(condition: Condition, curves: Iterable[Condition]) -> int:
    """Return the weakest compression of all conditions that differ in nothing else."""
    alike = (other for other in curves if _compressed(other, 0) == _compressed(condition, 0))
    return min(other.compression_query for other in alike)


def _as_good(curve: Curve, clean: RunRecord) -> RunRecord | None:
    """Return the shortest window of a curve that is as accurate as a clean one."""
    return next((run for run in curve if run.accuracy >= clean.accuracy), None)
