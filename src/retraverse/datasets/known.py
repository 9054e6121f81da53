"""The datasets the studies know by name: where their pictures lie, whose they are, what is true.

None of them is shipped. A *data root* is a folder with one folder per dataset; a dataset is there
if both drives are. Any other folder with ``query`` and ``reference`` drives in it is a dataset
too, called by its name: one's own route.

Conventions
- Pairs are index-aligned unless a truth file lies beside the drives.
- A tolerance counts the frames that are used; where a drive is thinned, the truth's description
  says it in files too.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.known_list import KNOWN, KnownDataset
from retraverse.datasets.position_files import load_positions
from retraverse.datasets.truth_sources import aligned, from_positions, ground_truth
from retraverse.errors import DataMissingError, InputError
from retraverse.images import Traverse, open_traverse
from retraverse.types import Array

__all__ = [
    "Dataset",
    "KnownDataset",
    "find_dataset",
    "known_dataset",
    "known_datasets",
    "open_dataset",
]


@dataclass(frozen=True)
class Dataset:
    """A dataset whose pictures are here."""

    known: KnownDataset
    """What is known of it."""
    query_source: Path
    """Folder, or video, of the drive to locate."""
    reference_source: Path
    """Folder, or video, of the earlier drive."""
    truth_file: Path | None = None
    """JSON of query frame -> reference frames; None = positions, or aligned."""
    position_files: tuple[Path, Path] | None = None
    """Tables of metres of query and reference; None = `truth_file`, or aligned."""
    radius_m: float = 25.0
    """How near is right, with positions."""

    @property
    def name(self) -> str:
        """What plans call it."""
        return self.known.name

    def query(self) -> Traverse:
        """Return the drive to locate; its files are listed once."""
        return self._query

    def reference(self) -> Traverse:
        """Return the earlier drive, the map; its files are listed once."""
        return self._reference

    def truth(self) -> GroundTruth:
        """Return which frames of the two show one place.

        Raises
        ------
        InputError
            If the truth is of drives of other lengths, or its file cannot be read.
        """
        return self._truth

    @property
    def tolerance_frames(self) -> int:
        """Frames a match may be off; -1 where the truth is not counted in frames."""
        if self.truth().tolerance_frames is not None:
            return int(self.truth().tolerance_frames or 0)
        return self.known.tolerance_frames if self.truth_file and self.known.citation else -1

    @property
    def is_as_in_thesis(self) -> bool:
        """Whether it has as many frames as the thesis says: its published values then apply."""
        return self.known.thesis_sizes == (len(self._query), len(self._reference))

    @cached_property
    def _query(self) -> Traverse:
        return open_traverse(self.query_source, every=self.known.every)

    @cached_property
    def _reference(self) -> Traverse:
        return open_traverse(self.reference_source, every=self.known.every)

    @cached_property
    def _truth(self) -> GroundTruth:
        if self.truth_file is not None:
            return self._listed(self.truth_file)
        if self.position_files is not None:
            drives = (self._query, self._reference)
            pairs = zip(self.position_files, drives, strict=True)
            query, reference = (_positions(file, drive) for file, drive in pairs)
            return from_positions(query, reference, radius_m=self.radius_m)
        return aligned(
            len(self._query),
            len(self._reference),
            self.known.tolerance_frames,
            every=self.known.every,
        )

    def _listed(self, path: Path) -> GroundTruth:
        truth = ground_truth(path).select(self._query.indices, self._reference.indices)
        if truth.n_queries != len(self._query):
            raise InputError(
                f"{path}: got {truth.n_queries} queries, expected {len(self._query)}, "
                f"as many as pictures in {self.query_source}"
            )
        return truth


def known_datasets() -> list[KnownDataset]:
    """Return every dataset known by name: first those with free pictures, then the thesis' own."""
    return list(KNOWN)


def known_dataset(name: str) -> KnownDataset | None:
    """Return what is known of a dataset, None if it is not one of `known_datasets`."""
    return next((known for known in KNOWN if known.name == name), None)


def find_dataset(name: str, root: Path) -> Dataset | None:
    """Return a dataset under a data root, None if it is not there.

    Parameters
    ----------
    name : str
        One of `known_datasets`, or the name of a folder with ``query`` and ``reference`` drives.
    root : Path
        The data root.

    Notes
    -----
    The truth is ``ground_truth.json`` in the dataset's folder, else ``positions.csv`` in both
    drives (25 m), else the frame numbers, with the dataset's tolerance.
    """
    known = known_dataset(name) or KnownDataset(name, name, "", "one's own pictures")
    for folder in (known.name, *known.folders):
        query = _first_folder(root / folder, known.query)
        reference = _first_folder(root / folder, known.reference)
        if query is not None and reference is not None:
            return _with_truth(known, query, reference, root / folder)
    return None


def open_dataset(
    name: str,
    query: Path,
    reference: Path,
    *,
    truth_file: Path | None = None,
    radius_m: float | None = None,
    tolerance_frames: int = 2,
    every: int = 1,
) -> Dataset:
    """Return a dataset of any two drives; see `Dataset` for the truth.

    Parameters
    ----------
    name : str
        For records.
    query, reference : Path
        Folders or videos.
    truth_file : Path, optional
        JSON of query frame -> reference frames.
    radius_m : float, optional
        Take the tables ``positions.csv`` of both folders, right within this many metres.
    tolerance_frames, every : int
        See `KnownDataset`.

    Raises
    ------
    DataMissingError
        If a drive, the truth file or a table is not there.
    """
    tables = (query / "positions.csv", reference / "positions.csv")
    needed = [query, reference, *([truth_file] if truth_file else [])]
    needed += list(tables) if radius_m is not None else []
    for path in needed:
        if not path.exists():
            raise DataMissingError(f"dataset {name}: {path} does not exist")
    known = KnownDataset(
        name,
        name,
        "",
        "one's own pictures",
        every=every,
        tolerance_frames=tolerance_frames,
    )
    return Dataset(
        known,
        query,
        reference,
        truth_file,
        tables if radius_m is not None else None,
        25.0 if radius_m is None else radius_m,
    )


def _positions(table: Path, drive: Traverse) -> Array:
    """Return the positions of the frames that are used, from a table of the whole drive."""
    positions = load_positions(table)
    if len(positions) <= drive.indices.max():
        raise InputError(
            f"{table}: got {len(positions)} rows, expected at least {drive.indices.max() + 1}, one "
            f"per picture of {drive.name}"
        )
    return np.asarray(positions[drive.indices])


def _first_folder(folder: Path, names: Iterable[str]) -> Path | None:
    return next((folder / name for name in names if (folder / name).is_dir()), None)


def _with_truth(known: KnownDataset, query: Path, reference: Path, folder: Path) -> Dataset:
    listed = folder / "ground_truth.json"
    tables = (query / "positions.csv", reference / "positions.csv")
    if listed.is_file():
        return Dataset(known, query, reference, truth_file=listed)
    if known.citation == "" and all(table.is_file() for table in tables):
        return Dataset(known, query, reference, position_files=tables)
    return Dataset(known, query, reference)
