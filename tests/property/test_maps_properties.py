"""What holds for any frames: nothing is lost on the way to the disk and back, however it went."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.maps.fakes import FakeTechnique, fake_registered, snapshot

from retraverse.images import Frame
from retraverse.maps import RouteMap, build_map, load_map
from retraverse.maps import segment as segment_room


@pytest.fixture(autouse=True)
def _fake() -> Iterator[None]:
    with fake_registered():
        yield


# Any text but "\0"; lone surrogates stand for file names that are not UTF-8.
NAMES = st.text(st.one_of(st.characters(exclude_characters="\0", codec="utf-8"), st.just("\udcff")))
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def any_frame(draw: st.DrawFn) -> Frame:
    pixels = np.random.default_rng(draw(st.integers(0, 9))).integers(0, 255, (6, 8, 3))
    return Frame.from_array(
        pixels.astype(np.uint8),
        name=draw(NAMES) or "x",
        index=draw(st.integers(0, 1 << 60)),
        timestamp_s=draw(st.none() | NUMBERS),
    )


@dataclass(frozen=True)
class Route:
    frames: list[Frame]
    positions: list[list[float]] | None
    thumbnails: int | None
    segment_bytes: int

    def build(self, rows: slice, path: Path | None = None) -> RouteMap:
        positions = None if self.positions is None else self.positions[rows]
        return build_map(
            self.frames[rows],
            FakeTechnique(),
            positions=positions,
            thumbnails=self.thumbnails,
            path=path,
            threads=1,
        )

    def extend(self, route: RouteMap, rows: slice) -> None:
        positions = None if self.positions is None else self.positions[rows]
        route.extend(self.frames[rows], positions=positions, threads=1)


@st.composite
def routes(draw: st.DrawFn) -> Route:
    drive = draw(st.lists(any_frame(), min_size=1, max_size=12))
    columns = draw(st.integers(0, 2))
    row = st.lists(NUMBERS, min_size=columns, max_size=columns)
    positions = draw(st.lists(row, min_size=len(drive), max_size=len(drive)))
    return Route(
        frames=drive,
        positions=positions if columns else None,
        thumbnails=draw(st.none() | st.just(16)),
        segment_bytes=draw(st.sampled_from([1, 400, 2000, 1 << 20])),
    )


@settings(max_examples=60, deadline=None)
@given(route=routes(), data=st.data())
def test_any_way_to_a_map_gives_the_same_map(route: Route, data: st.DataObject) -> None:
    """At once or in two steps, in memory or on disk, saved and loaded: all the same."""
    n_frames = len(route.frames)
    middle = data.draw(st.integers(1, n_frames))
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        whole = route.build(slice(None))
        expected = snapshot(whole)
        patch.setattr(segment_room, "SEGMENT_BYTES", route.segment_bytes)
        for path in (None, Path(folder) / "steps"):
            steps = route.build(slice(0, middle), path)
            if middle < n_frames:
                route.extend(steps, slice(middle, None))
            assert snapshot(steps) == expected
        steps.save(Path(folder) / "copy")
        for name in ("steps", "copy"):
            assert snapshot(load_map(Path(folder) / name)) == expected
    for frame, record in zip(route.frames, whole.frames, strict=True):
        assert (frame.name, frame.index, frame.timestamp_s) == (
            record.name,
            record.index,
            record.timestamp_s,
        )


@settings(max_examples=60, deadline=None)
@given(route=routes(), max_bytes=st.integers(1, 2000))
def test_blocks_are_the_descriptions_cut(route: Route, max_bytes: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_room, "SEGMENT_BYTES", route.segment_bytes)
        built = route.build(slice(None))
    blocks = list(built.blocks(max_bytes))
    lengths = [len(block) for _, block in blocks]
    assert [start for start, _ in blocks] == np.cumsum([0, *lengths[:-1]]).tolist()
    for name, array in built.descriptions().arrays.items():
        joined = np.concatenate([block.arrays[name] for _, block in blocks])
        assert np.array_equal(joined, array)
