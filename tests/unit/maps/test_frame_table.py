import numpy as np
import pytest

from retraverse.errors import InputError, ShapeError
from retraverse.maps.frame_table import FrameRecord, FrameTable, read_positions

RECORDS = [
    FrameRecord("a.jpg", 0),
    FrameRecord("a.jpg", 3, timestamp_s=1.5),
    FrameRecord("straße \udcff\n,", 7, timestamp_s=-2.0),
    FrameRecord("", 9, timestamp_s=1e9),
]


def test_rows_come_back_as_they_were() -> None:
    table = FrameTable.stack(RECORDS)
    assert list(table) == RECORDS
    assert len(table) == 4
    assert list(table[1:3]) == RECORDS[1:3]
    assert table.position is None


def test_tables_join_end_to_end() -> None:
    parts = [FrameTable.stack(RECORDS[:1]), FrameTable.stack(RECORDS[1:])]
    assert list(FrameTable.concatenate(parts)) == RECORDS


@pytest.mark.parametrize("position", [(1.5,), (-3.0, 4.25)])
def test_positions_have_one_or_two_columns(position: tuple[float, ...]) -> None:
    records = [FrameRecord("a", 0, position=position), FrameRecord("b", 1, position=position)]
    table = FrameTable.concatenate([FrameTable.stack(records), FrameTable.stack(records)])
    assert list(table) == records * 2
    assert table.position is not None
    assert table.position.shape == (4, len(position))


def test_tensors_hold_the_whole_table() -> None:
    table = FrameTable.stack(RECORDS)
    tensors = table.tensors()
    assert list(FrameTable.from_tensors(tensors, "file")) == RECORDS
    specs = FrameTable.tensor_specs(len(table), 0)
    assert {name: array.dtype.name for name, array in tensors.items()} == {
        name: dtype for name, (dtype, _) in specs.items()
    }


@pytest.mark.parametrize("given", [[1, 2, 3], [[1], [2], [3]], [[1, 2], [3, 4], [5, 6]]])
def test_positions_are_read_as_metres(given: list[object]) -> None:
    metres = read_positions(given, 3)
    assert metres is not None
    assert metres.dtype == np.float64
    assert metres.tolist() == np.array(given).reshape(3, -1).tolist()
    assert read_positions(None, 3) is None


def test_positions_are_a_copy() -> None:
    given = np.zeros((2, 2))
    metres = read_positions(given, 2)
    given[0] = 7
    assert metres is not None
    assert not metres.any()


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ([1, 2], ShapeError, r"got shape \(2,\), expected \(3,\) or \(3, 2\)"),
        (np.zeros((3, 3)), ShapeError, r"got shape \(3, 3\)"),
        (np.zeros((3, 0)), ShapeError, r"got shape \(3, 0\)"),
        (5, ShapeError, r"got shape \(\)"),
        ([1, np.nan, 3], InputError, r"row 1 is \[nan\], expected finite"),
        ([[1, 2], [3, 4], [5, np.inf]], InputError, "row 2"),
        (["a", "b", "c"], InputError, "not numbers"),
        ([[1], [1, 2], [3]], InputError, "not numbers"),
    ],
)
def test_positions_that_make_no_sense(
    given: list[object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        read_positions(given, 3)
