"""What a technique is: a picture in, named arrays out, and how two sets of them compare.

Conventions
- A *description* is a dict of arrays for one frame; the one named ``"descriptor"`` is what
  is matched, others (region entropies, say) only weight it.
- `Descriptions` stacks them: every array gets a leading axis, one row per frame.
- ``similarity[query, reference]``: rows are queries, higher is better.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np

from retraverse.errors import ShapeError
from retraverse.images import Frame
from retraverse.types import Array, FloatArray, ImageArray

__all__ = [
    "ArraySpec",
    "BatchTechnique",
    "Description",
    "Descriptions",
    "FingerprintedTechnique",
    "Layout",
    "RegionalTechnique",
    "Technique",
]

Description = dict[str, Array]
"""One frame: array name -> array, as the technique's `Layout` promises."""


@dataclass(frozen=True)
class ArraySpec:
    """Shape and data type of one array of a description."""

    shape: tuple[int, ...]
    dtype: str

    @property
    def n_numbers(self) -> int:
        """Numbers of one frame."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def n_bytes(self) -> int:
        """Bytes one frame takes."""
        return self.n_numbers * np.dtype(self.dtype).itemsize


@dataclass(frozen=True)
class Layout:
    """What a technique's descriptions look like: the contract that maps are written by."""

    kind: Literal["global", "regional"]
    """``global``: one vector a frame; ``regional``: one row per region."""
    arrays: Mapping[str, ArraySpec]
    """Array name -> its shape and type; always has ``"descriptor"``."""

    @property
    def descriptor(self) -> ArraySpec:
        """The array that is matched."""
        return self.arrays["descriptor"]

    @property
    def dimension(self) -> int:
        """How many numbers the descriptor of one frame holds."""
        return self.descriptor.n_numbers


@dataclass(frozen=True)
class Descriptions:
    """Descriptions of many frames, stacked.

    Slicing gives `Descriptions` that share memory with these.
    """

    arrays: Mapping[str, Array]
    """Array name -> array with a leading axis of one row per frame."""

    def __len__(self) -> int:
        return len(self.arrays["descriptor"])

    def __getitem__(self, rows: slice) -> "Descriptions":
        return Descriptions({name: array[rows] for name, array in self.arrays.items()})

    @property
    def descriptor(self) -> Array:
        """The matched array, shape (N, ...)."""
        return self.arrays["descriptor"]

    @classmethod
    def stack(cls, descriptions: Iterable[Description], layout: Layout) -> "Descriptions":
        """Stack descriptions of single frames; none at all gives arrays of no rows.

        Raises
        ------
        ShapeError
            If an array differs from what `layout` promises.
        """
        listed = list(descriptions)
        arrays = {}
        for name, spec in layout.arrays.items():
            stacked = np.zeros((len(listed), *spec.shape), spec.dtype)
            for row, description in enumerate(listed):
                value = description[name]
                if value.shape != spec.shape or value.dtype != np.dtype(spec.dtype):
                    raise ShapeError(
                        f"array {name!r} of a description: got {value.dtype} {value.shape}, "
                        f"expected {spec.dtype} {spec.shape}"
                    )
                stacked[row] = value
            arrays[name] = stacked
        return cls(arrays)

    @classmethod
    def concatenate(cls, parts: Iterable["Descriptions"]) -> "Descriptions":
        """Join descriptions end to end."""
        listed = list(parts)
        return cls(
            {
                name: np.concatenate([part.arrays[name] for part in listed])
                for name in listed[0].arrays
            }
        )

    def blocks(self, n_rows: int) -> Iterator["Descriptions"]:
        """Yield consecutive slices of at most `n_rows` frames."""
        for start in range(0, len(self), n_rows):
            yield self[start : start + n_rows]


class Technique(Protocol):
    """How pictures become descriptions, and how alike two descriptions are."""

    name: ClassVar[str]
    """What users call it: ``"convsequential"``."""
    summary: ClassVar[str]
    """One line for lists."""
    citation: ClassVar[str]
    """Author, title, venue, year."""
    version: ClassVar[int]
    """Raised whenever the same picture would give other descriptions; stored in every map."""
    parameters: Any
    """A frozen dataclass; the map stores it."""
    layout: Layout

    def read(self, frame: Frame) -> ImageArray:
        """Return the pixels this technique looks at: its grey path or colour, unresized."""
        ...

    def describe(self, image: ImageArray) -> Description:
        """Return the description of one picture (what t_e measures). Thread-safe."""
        ...

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return float32 (Q, R), higher is more alike."""
        ...


@runtime_checkable
class RegionalTechnique(Technique, Protocol):
    """A technique whose regions can be weighted from outside: by another frame's ROI, say."""

    def region_weights(self, queries: Descriptions) -> FloatArray:
        """Return float32 (Q, regions): what each region of a query counts; a row sums to 1."""
        ...

    def weighted_similarity(
        self, query: Array, references: Array, weights: FloatArray
    ) -> FloatArray:
        """Return float32 (M, R): one query's regions against R references under M weightings."""
        ...


@runtime_checkable
class BatchTechnique(Technique, Protocol):
    """A technique that may describe several pictures at once faster than one by one."""

    def batch_size(self) -> int:
        """Return how many pictures at once are fastest; 1 where batches do not help."""
        ...

    def describe_batch(self, images: Sequence[ImageArray]) -> list[Description]:
        """Return the descriptions that `describe` gives, within the rounding of floats."""
        ...


@runtime_checkable
class FingerprintedTechnique(Technique, Protocol):
    """A technique whose parameters only name a part of it, such as a file of trained weights."""

    def fingerprint(self) -> str:
        """Return the SHA-256 of that part's content, 64 hexadecimal digits."""
        ...
