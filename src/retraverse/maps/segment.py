"""A segment: consecutive frames of a route with all a map keeps of them, in one piece.

On disk a segment is one file. Files hold about `SEGMENT_BYTES`, so that a map is built and
read piece by piece, and a map that grows rewrites none but a small last one.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from retraverse.maps.describe import DescribedFrame
from retraverse.maps.frame_table import FrameTable
from retraverse.maps.ragged import check_ragged, pack, unpack
from retraverse.maps.tensor_file import TensorSpecs
from retraverse.maps.thumbnails import Thumbnails
from retraverse.techniques import Descriptions, Layout
from retraverse.types import Array

__all__ = ["SEGMENT_BYTES", "Segment", "gather", "split_small_end"]

SEGMENT_BYTES = 32 << 20
"""What a segment may hold; a single frame that is larger gets one of its own."""

_description, _content = "description.", "frame.content_sha256"
_jpeg, _jpeg_ends = "thumbnail.jpeg", "thumbnail.ends"


@dataclass(frozen=True)
class Segment:
    """Consecutive frames of a map; all arrays read-only."""

    descriptions: Descriptions
    frames: FrameTable
    content: Array
    """Uint8 (N, 32): SHA-256 of each frame's picture."""
    thumbnails: Thumbnails | None

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def n_bytes(self) -> int:
        """Bytes of all its arrays."""
        return sum(array.nbytes for array in self.tensors().values())

    def thumbnail(self, row: int) -> bytes | None:
        """Return the JPEG file of one frame, or None where the map keeps none."""
        if self.thumbnails is None:
            return None
        return unpack(self.thumbnails.text, self.thumbnails.ends, row)

    def rows(self) -> Iterator[DescribedFrame]:
        """Yield the frames one by one again, as they were gathered."""
        for row, record in enumerate(self.frames):
            yield DescribedFrame(
                record=record,
                description={name: array[row] for name, array in self.descriptions.arrays.items()},
                content=self.content[row].tobytes(),
                thumbnail=self.thumbnail(row),
                describe_s=float("nan"),
            )

    def tensors(self) -> dict[str, Array]:
        """Return everything as named arrays, the way it lies in a file."""
        tensors = {_description + name: array for name, array in self.descriptions.arrays.items()}
        tensors |= {**self.frames.tensors(), _content: self.content}
        if self.thumbnails is not None:
            tensors |= {_jpeg: self.thumbnails.text, _jpeg_ends: self.thumbnails.ends}
        return tensors

    @classmethod
    def stack(cls, described: list[DescribedFrame], layout: Layout) -> "Segment":
        """Return `described` as one segment.

        Raises
        ------
        ShapeError
            If a description is not what the technique's layout promises.
        """
        content = np.frombuffer(b"".join(frame.content for frame in described), np.uint8)
        descriptions = Descriptions.stack((frame.description for frame in described), layout)
        for array in descriptions.arrays.values():
            # As in a mapped file: nobody changes a map's descriptors by mistake.
            array.flags.writeable = False
        pictures = [frame.thumbnail for frame in described if frame.thumbnail is not None]
        return cls(
            descriptions=descriptions,
            frames=FrameTable.stack([frame.record for frame in described]),
            content=content.reshape(-1, 32),
            thumbnails=Thumbnails(*pack(pictures)) if pictures else None,
        )

    @classmethod
    def from_tensors(cls, tensors: Mapping[str, Array], what: str) -> "Segment":
        """Return the segment that `tensors` gave; they fulfil `tensor_specs`.

        Raises
        ------
        MapError
            If names or thumbnails do not fit; the message starts with `what`.
        """
        thumbnails = None
        if _jpeg in tensors:
            thumbnails = Thumbnails(tensors[_jpeg], tensors[_jpeg_ends])
            check_ragged(thumbnails.text, thumbnails.ends, f"{what}: thumbnails")
        arrays = {
            name.removeprefix(_description): array
            for name, array in tensors.items()
            if name.startswith(_description)
        }
        return cls(
            descriptions=Descriptions(arrays),
            frames=FrameTable.from_tensors(tensors, what),
            content=tensors[_content],
            thumbnails=thumbnails,
        )

    @staticmethod
    def tensor_specs(
        n_frames: int, layout: Layout, *, position_columns: int, has_thumbnails: bool
    ) -> TensorSpecs:
        """Return what the file of a segment must hold."""
        specs: dict[str, tuple[str, tuple[int | None, ...]]] = {
            _description + name: (np.dtype(spec.dtype).name, (n_frames, *spec.shape))
            for name, spec in layout.arrays.items()
        }
        specs |= FrameTable.tensor_specs(n_frames, position_columns)
        specs[_content] = ("uint8", (n_frames, 32))
        if has_thumbnails:
            specs |= {_jpeg: ("uint8", (None,)), _jpeg_ends: ("int64", (n_frames,))}
        return specs


def gather(described: Iterable[DescribedFrame], layout: Layout) -> Iterator[Segment]:
    """Yield segments of at most `SEGMENT_BYTES`; memory holds two of them."""
    waiting: list[DescribedFrame] = []
    size = 0
    for frame in described:
        n_bytes = _frame_bytes(frame, layout)
        if waiting and size + n_bytes > SEGMENT_BYTES:
            segment = Segment.stack(waiting, layout)
            waiting, size = [], 0
            yield segment
        waiting.append(frame)
        size += n_bytes
    if waiting:
        yield Segment.stack(waiting, layout)


def split_small_end(
    segments: tuple[Segment, ...],
) -> tuple[tuple[Segment, ...], Iterable[DescribedFrame]]:
    """Return the segments to keep, and the frames of a small last one, to be written anew.

    A map that grows frame by frame would otherwise end as one file per frame.
    """
    if segments[-1].n_bytes * 2 > SEGMENT_BYTES:
        return segments, ()
    return segments[:-1], segments[-1].rows()


def _frame_bytes(frame: DescribedFrame, layout: Layout) -> int:
    columns = 8 * (3 + len(frame.record.position or ())) + len(frame.content)
    picture = 0 if frame.thumbnail is None else 8 + len(frame.thumbnail)
    name = len(frame.record.name.encode("utf-8", "surrogateescape"))
    return sum(spec.n_bytes for spec in layout.arrays.values()) + columns + picture + name
