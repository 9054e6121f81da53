"""The real drives of the tables: which folders, how thinned, which tolerance."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import retraverse as rt
from retraverse.types import FloatArray

FOLDERS: dict[str, tuple[str, str, int, int]] = {
    "corridor": ("reference", "query", 1, 2),
    "stromovka": ("autumn", "snow", 1, 2),
    "gardens_point_thumbnails": ("reference", "query", 1, 2),
    "nordland_64x32": ("summer", "winter", 20, 1),
}


@dataclass(frozen=True)
class RealSet:
    """Two drives along one route, and their truth."""

    name: str
    reference: rt.Traverse
    query: rt.Traverse
    truth: rt.GroundTruth


def data_folder() -> Path:
    """Return the folder named on the command line, or the one beside the project."""
    return Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data")


def real_sets(data: Path) -> Iterator[RealSet]:
    """Yield the drives that are here; say which are not."""
    for name, (reference_folder, query_folder, every, tolerance) in FOLDERS.items():
        if not (data / name).is_dir():
            print(f"\n{name}: not here")
            continue
        reference = rt.open_traverse(data / name / reference_folder, every=every)
        query = rt.open_traverse(data / name / query_folder, every=every)
        truth = rt.aligned(len(query), len(reference), tolerance, every=every)
        yield RealSet(name, reference, query, truth)


def accuracy(scores: FloatArray, truth: rt.GroundTruth, sequence_length: int) -> float:
    """Return the accuracy of the windows answered."""
    matches = rt.match_similarity(scores, sequence_length=sequence_length)
    return rt.evaluate(matches, truth).accuracy
