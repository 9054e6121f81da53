"""What a map knows of each frame besides its descriptor: name, place in the source, time, position.

Conventions
- One row per frame, in route order; two rows may have the same name.
- Times in seconds; positions in metres, one column (along the route) or two (east, north).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from retraverse.errors import InputError, ShapeError
from retraverse.maps.ragged import check_ragged, pack, unpack
from retraverse.types import Array, IntArray

__all__ = ["FrameRecord", "FrameTable", "read_positions"]

_names, _ends, _index, _time, _position = (
    f"frame.{column}" for column in ("names", "name_ends", "index", "timestamp_s", "position")
)


@dataclass(frozen=True)
class FrameRecord:
    """One row of a `FrameTable`."""

    name: str
    """File name, or what the source calls the frame."""
    index: int
    """Position in the source, counted before anything was skipped."""
    timestamp_s: float | None = None
    """Seconds, on the source's own clock; None where it has none."""
    position: tuple[float, ...] | None = None
    """Metres, one value or two; None where the map has no positions."""


@dataclass(frozen=True)
class FrameTable:
    """The frames of a map, by columns."""

    names: tuple[str, ...]
    index: IntArray
    """Int64 (N,): position in the source."""
    timestamp_s: Array
    """Float64 (N,): seconds, NaN = not known."""
    position: Array | None
    """Float64 (N, 1) or (N, 2): metres; None where the map has no positions."""

    def __len__(self) -> int:
        return len(self.names)

    @overload
    def __getitem__(self, row: int) -> FrameRecord: ...
    @overload
    def __getitem__(self, row: slice) -> "FrameTable": ...
    def __getitem__(self, row: int | slice) -> "FrameRecord | FrameTable":
        position = None if self.position is None else self.position[row]
        if isinstance(row, slice):
            return FrameTable(self.names[row], self.index[row], self.timestamp_s[row], position)
        time = float(self.timestamp_s[row])
        return FrameRecord(
            name=self.names[row],
            index=int(self.index[row]),
            timestamp_s=None if np.isnan(time) else time,
            position=None if position is None else tuple(position.tolist()),
        )

    def __iter__(self) -> Iterator[FrameRecord]:
        return (self[row] for row in range(len(self)))

    @classmethod
    def stack(cls, records: Sequence[FrameRecord]) -> "FrameTable":
        """Return one table of `records`; all of them have a position or none has."""
        times = [np.nan if record.timestamp_s is None else record.timestamp_s for record in records]
        positions = [record.position for record in records if record.position is not None]
        return cls(
            names=tuple(record.name for record in records),
            index=np.array([record.index for record in records], np.int64),
            timestamp_s=np.array(times, np.float64),
            position=np.array(positions, np.float64) if positions else None,
        )

    @classmethod
    def concatenate(cls, tables: Sequence["FrameTable"]) -> "FrameTable":
        """Join tables end to end; at least one, all with positions of the same width or none."""
        positions = [table.position for table in tables if table.position is not None]
        return cls(
            names=tuple(name for table in tables for name in table.names),
            index=np.concatenate([table.index for table in tables]),
            timestamp_s=np.concatenate([table.timestamp_s for table in tables]),
            position=np.concatenate(positions) if positions else None,
        )

    def tensors(self) -> dict[str, Array]:
        """Return the table as named arrays, the way it lies in a file."""
        # File names that are not UTF-8 reach Python as lone surrogates; this keeps their bytes.
        text, ends = pack([name.encode("utf-8", "surrogateescape") for name in self.names])
        tensors = {_names: text, _ends: ends, _index: self.index, _time: self.timestamp_s}
        return tensors if self.position is None else {**tensors, _position: self.position}

    @classmethod
    def from_tensors(cls, tensors: Mapping[str, Array], what: str) -> "FrameTable":
        """Return the table that `tensors` gave.

        Raises
        ------
        MapError
            If the names do not fit; the message starts with `what`.
        """
        text, ends = tensors[_names], tensors[_ends]
        check_ragged(text, ends, f"{what}: frame names")
        names = (
            unpack(text, ends, row).decode("utf-8", "surrogateescape") for row in range(len(ends))
        )
        # Copies: the table outlives the file's mapping and is small.
        position = tensors.get(_position)
        return cls(
            names=tuple(names),
            index=tensors[_index].copy(),
            timestamp_s=tensors[_time].copy(),
            position=None if position is None else position.copy(),
        )

    @staticmethod
    def tensor_specs(
        n_frames: int, position_columns: int
    ) -> dict[str, tuple[str, tuple[int | None, ...]]]:
        """Return what a file must hold: array name -> data type and shape (None = any length)."""
        specs: dict[str, tuple[str, tuple[int | None, ...]]] = {
            _names: ("uint8", (None,)),
            _ends: ("int64", (n_frames,)),
            _index: ("int64", (n_frames,)),
            _time: ("float64", (n_frames,)),
        }
        if position_columns:
            specs[_position] = ("float64", (n_frames, position_columns))
        return specs


def read_positions(positions: Array | Sequence[object] | None, n_frames: int) -> Array | None:
    """Return positions as float64 (N, 1) or (N, 2).

    Parameters
    ----------
    positions : array, shape (N,), (N, 1) or (N, 2), or None
        Metres: along the route, or east and north.
    n_frames : int
        N.

    Raises
    ------
    ShapeError
        If there are not as many as frames, or more than two columns.
    InputError
        If one is not a finite number.
    """
    if positions is None:
        return None
    try:
        array = np.array(positions, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("positions: got values that are not numbers, expected metres") from error
    shape = array.shape
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2 or array.shape[0] != n_frames or array.shape[1] not in (1, 2):
        raise ShapeError(
            f"positions: got shape {shape}, expected ({n_frames},) or ({n_frames}, 2): one row "
            " per frame that is read (did skipping or thinning drop frames?)"
        )
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InputError(f"positions: row {row} is {array[row].tolist()}, expected finite metres")
    return array
