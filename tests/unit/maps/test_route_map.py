import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.maps.fakes import FakeParameters, FakeTechnique, frames, snapshot

from retraverse.errors import (
    ConfigError,
    DataMissingError,
    FrameReadError,
    InputError,
    MapError,
    ShapeError,
)
from retraverse.images import Frame, open_traverse
from retraverse.maps import RouteMap, build_map, load_map
from retraverse.maps import segment as segment_room

WHITE = Frame.from_array(np.full((6, 8, 3), 255, np.uint8), name="white.jpg")


@pytest.fixture(params=["memory", "disk"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Path | None:
    return tmp_path / "route.map" if request.param == "disk" else None


@pytest.fixture
def small_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make segments hold three frames of the fake technique."""
    monkeypatch.setattr(segment_room, "SEGMENT_BYTES", 3 * 160)


def everything_in(folder: Path) -> list[str]:
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*"))


def test_a_map_holds_what_the_technique_said(place: Path | None, small_segments: None) -> None:
    technique, drive = FakeTechnique(), frames(10)
    route = build_map(drive, technique, path=place)
    assert len(route) == route.n_frames == 10
    assert route.technique is technique
    assert route.path == place
    assert [frame.name for frame in route.frames] == [frame.name for frame in drive]
    for row, frame in enumerate(drive):
        expected = technique.describe(technique.read(frame))
        got = route.descriptions(row, row + 1).arrays
        assert all(np.array_equal(got[name][0], expected[name]) for name in expected)
        assert route.frames[row].timestamp_s == frame.timestamp_s
        assert route.frames[row].index == frame.index


def test_disk_and_memory_and_any_number_of_threads_agree(tmp_path: Path) -> None:
    maps = [
        build_map(frames(9), FakeTechnique(), thumbnails=16, threads=threads, path=path)
        for threads in (1, 2, 5)
        for path in (None, tmp_path / f"{threads}.map")
    ]
    assert all(snapshot(route) == snapshot(maps[0]) for route in maps[1:])
    files = [everything_in(tmp_path / f"{threads}.map") for threads in (1, 2, 5)]
    assert files[0] == files[1] == files[2]


@pytest.mark.parametrize("max_bytes", [1, 200, 100_000])
def test_blocks_cover_the_route_once(
    max_bytes: int, place: Path | None, small_segments: None
) -> None:
    route = build_map(frames(10), FakeTechnique(), path=place)
    whole = route.descriptions()
    per_frame = route.info()["bytes_per_frame"]
    expected_start = 0
    for start, block in route.blocks(max_bytes):
        assert start == expected_start
        assert len(block) * per_frame <= max_bytes or len(block) == 1
        for name, array in block.arrays.items():
            assert np.array_equal(array, whole.arrays[name][start : start + len(block)])
        expected_start += len(block)
    assert expected_start == 10


def test_descriptions_are_sliced_like_python(small_segments: None) -> None:
    route = build_map(frames(10), FakeTechnique())
    whole = route.descriptions().descriptor
    for start, stop in [(0, 10), (2, 3), (2, 9), (-3, None), (4, 4), (7, 2), (0, 99), (0, -1)]:
        assert np.array_equal(route.descriptions(start, stop).descriptor, whole[start:stop])


def test_descriptors_cannot_be_changed(place: Path | None) -> None:
    route = build_map(frames(2), FakeTechnique(), path=place)
    for _, block in route.blocks():
        assert not any(array.flags.writeable for array in block.arrays.values())


def test_load_gives_back_what_was_built(tmp_path: Path, small_segments: None) -> None:
    positions = np.linspace(0, 9, 20).reshape(10, 2)
    built = build_map(
        frames(10), FakeTechnique(), path=tmp_path / "a", positions=positions, thumbnails=16
    )
    for verify in (True, False):
        loaded = load_map(tmp_path / "a", verify=verify)
        assert snapshot(loaded) == snapshot(built)
        assert loaded.technique.parameters == built.technique.parameters
        assert loaded.provenance == built.provenance
        assert loaded.info() == built.info()


@pytest.mark.parametrize("columns", [0, 1, 2])
def test_save_writes_a_copy(place: Path | None, columns: int, tmp_path: Path) -> None:
    positions = np.ones((4, columns)) if columns else None
    route = build_map(frames(4), FakeTechnique(), path=place, positions=positions)
    route.save(tmp_path / "copy")
    assert route.path == place
    assert snapshot(load_map(tmp_path / "copy")) == snapshot(route)
    assert load_map(tmp_path / "copy").provenance == route.provenance


def test_save_replaces_only_when_told(tmp_path: Path) -> None:
    old, new = build_map(frames(4), FakeTechnique()), build_map(frames(6), FakeTechnique())
    old.save(tmp_path / "a")
    with pytest.raises(MapError, match="exists already; choose another name, or overwrite it"):
        new.save(tmp_path / "a")
    assert snapshot(load_map(tmp_path / "a")) == snapshot(old)
    still_old = load_map(tmp_path / "a")
    new.save(tmp_path / "a", overwrite=True)
    assert snapshot(load_map(tmp_path / "a")) == snapshot(new)
    assert snapshot(still_old) == snapshot(old), "who has the old map open keeps it"
    assert len(everything_in(tmp_path / "a")) == 4  # manifest, lock, folder, one segment


def test_a_map_can_be_saved_over_itself(tmp_path: Path, small_segments: None) -> None:
    route = build_map(frames(8), FakeTechnique(), path=tmp_path / "a", thumbnails=16)
    route.save(tmp_path / "a", overwrite=True)
    assert snapshot(load_map(tmp_path / "a")) == snapshot(route)


@pytest.mark.parametrize("what", ["file", "folder", "damaged"])
def test_only_a_map_is_ever_overwritten(tmp_path: Path, what: str) -> None:
    place = tmp_path / "a"
    if what == "file":
        place.write_text("precious")
    else:
        place.mkdir()
        (place / ("manifest.json" if what == "damaged" else "photo.jpg")).write_text("precious")
    with pytest.raises(MapError):
        build_map(frames(2), FakeTechnique(), path=place, overwrite=True)
    kept = place if what == "file" else next(place.iterdir())
    assert kept.read_text() == "precious"
    assert not list(tmp_path.glob(".*"))


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    build_map(frames(2), FakeTechnique(), path=tmp_path / "a")
    assert len(load_map(tmp_path / "a")) == 2


def test_files_of_others_inside_a_map_are_left_alone(tmp_path: Path) -> None:
    route = build_map(frames(2), FakeTechnique(), path=tmp_path / "a")
    (tmp_path / "a" / "notes.txt").write_text("mine")
    (tmp_path / "a" / "segments" / "notes.txt").write_text("mine")
    route.extend(frames(2, first=2))
    assert {"notes.txt", "segments/notes.txt"} <= set(everything_in(tmp_path / "a"))


def test_the_folder_around_the_map_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match=r"no such folder; make it first, to hold a\.map"):
        build_map(frames(2), FakeTechnique(), path=tmp_path / "no" / "a.map")


def test_extending_is_building_both(place: Path | None, small_segments: None) -> None:
    both = build_map([*frames(5), *frames(6, first=5)], FakeTechnique(), thumbnails=16)
    route = build_map(frames(5), FakeTechnique(), path=place, thumbnails=16)
    assert route.extend(frames(6, first=5)) is route
    assert snapshot(route) == snapshot(both)
    assert [(step.action, step.n_frames) for step in route.provenance.history] == [
        ("build", 5),
        ("extend", 6),
    ]
    if place is not None:
        assert snapshot(load_map(place)) == snapshot(both)


def test_growing_frame_by_frame_does_not_make_a_file_per_frame(
    tmp_path: Path, small_segments: None
) -> None:
    route = build_map(frames(1), FakeTechnique(), path=tmp_path / "a")
    for first in range(1, 12):
        route.extend(frames(1, first=first))
    assert snapshot(route) == snapshot(build_map(frames(12), FakeTechnique()))
    assert 4 <= route.info()["n_segments"] <= 6
    assert len(list((tmp_path / "a" / "segments").iterdir())) == route.info()["n_segments"]


def test_a_reader_keeps_the_map_it_loaded(tmp_path: Path, small_segments: None) -> None:
    build_map(frames(4), FakeTechnique(), path=tmp_path / "a")
    reader = load_map(tmp_path / "a")
    before = snapshot(reader)
    load_map(tmp_path / "a").extend(frames(5, first=4))
    assert snapshot(reader) == before
    assert len(load_map(tmp_path / "a")) == 9


def test_a_map_changed_by_others_is_not_extended_blindly(tmp_path: Path) -> None:
    first = build_map(frames(4), FakeTechnique(), path=tmp_path / "a")
    load_map(tmp_path / "a").extend(frames(1, first=4))
    with pytest.raises(MapError, match="changed on disk since it was loaded; load it again"):
        first.extend(frames(1, first=4))
    assert len(load_map(tmp_path / "a")) == 5
    assert len(first) == 4


def test_blocks_begun_before_growing_end_as_they_began() -> None:
    route = build_map(frames(4), FakeTechnique())
    blocks = route.blocks(1)
    next(blocks)
    route.extend(frames(4, first=4))
    assert len(list(blocks)) == 3


def test_positions_go_with_the_map(place: Path | None) -> None:
    route = build_map(frames(3), FakeTechnique(), path=place, positions=[0, 1.5, 3])
    assert route.positions is not None
    assert route.positions.tolist() == [[0], [1.5], [3]]
    route.extend(frames(1), positions=[7])
    assert route.positions.tolist() == [[0], [1.5], [3], [7]]
    assert route.frames[3].position == (7.0,)
    with pytest.raises(InputError, match=r"got no positions, but the map has .* along the route"):
        route.extend(frames(1))
    with pytest.raises(InputError, match=r"got positions \(N, 2\), but the map has"):
        route.extend(frames(1), positions=[[7, 8]])
    assert len(route) == 4
    with pytest.raises(ShapeError, match="expected"):
        route.extend(frames(1), positions=[1, 2])
    bare = build_map(frames(1), FakeTechnique())
    with pytest.raises(InputError, match="but the map has no positions"):
        bare.extend(frames(1), positions=[1])


def test_thumbnails(place: Path | None, small_segments: None) -> None:
    route = build_map(frames(5), FakeTechnique(), path=place, thumbnails=16)
    pictures = [route.thumbnail(row) for row in range(5)]
    assert all(picture is not None and picture[:2] == b"\xff\xd8" for picture in pictures)
    assert len(set(pictures)) == 5
    for row in (-1, 5):
        with pytest.raises(InputError, match=f"got row {row}, expected 0 to 4"):
            route.thumbnail(row)
    assert build_map(frames(1), FakeTechnique()).thumbnail(0) is None
    with pytest.raises(ConfigError, match="longest side of 5 pixels"):
        build_map(frames(1), FakeTechnique(), thumbnails=5)


def test_two_frames_of_one_name(place: Path | None) -> None:
    route = build_map([*frames(2), *frames(2)], FakeTechnique(), path=place)
    assert [frame.name for frame in route.frames] == ["0-0.jpg", "0-1.jpg"] * 2


def test_provenance_says_where_the_map_came_from(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    for number in (2, 10):
        picture = np.full((6, 8, 3), number, np.uint8)
        (tmp_path / "pictures" / f"{number}.ppm").write_bytes(b"P6 8 6 255\n" + picture.tobytes())
    traverse = open_traverse(tmp_path / "pictures")
    provenance = build_map(traverse, FakeTechnique(FakeParameters(gain=2.5))).provenance
    assert provenance.source == traverse.source
    assert provenance.content_sha256 == traverse.content_hash()
    assert provenance.technique.name == "fake"
    assert provenance.technique.version == 3
    assert provenance.technique.parameters == {"size": 8, "gain": 2.5}
    assert provenance.created_at.endswith("+00:00")
    (step,) = provenance.history
    assert step.n_frames == 2
    assert step.retraverse
    assert "Python" in step.machine


def test_info_is_ready_for_json(place: Path | None) -> None:
    import json

    info = build_map(frames(50), FakeTechnique(), path=place, thumbnails=16).info()
    assert json.loads(json.dumps(info)) == info
    assert info["n_frames"] == 50
    assert info["technique"] == "fake"
    assert info["bytes_per_frame"] == 2 * 8 * 4 + 8 + 3
    assert info["thumbnail_max_side"] == 16
    assert info["position_columns"] == 0
    if place is not None:
        sizes = sum(file.stat().st_size for file in place.rglob("*") if file.is_file())
        assert info["total_bytes"] == sizes


def test_a_map_takes_little_more_than_its_descriptors(tmp_path: Path) -> None:
    technique = FakeTechnique(FakeParameters(size=72))
    info = build_map(frames(200), technique, path=tmp_path / "a").info()
    # Name, index, time and content hash take about 70 bytes a frame.
    assert info["total_bytes"] < 200 * (info["bytes_per_frame"] + 80) + 4000


def test_empty_traverses(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no frames in it"):
        build_map([], FakeTechnique(), path=tmp_path / "a")
    route = build_map(frames(1), FakeTechnique())
    with pytest.raises(InputError, match="no frames in it"):
        route.extend([])
    assert not list(tmp_path.iterdir())


def test_a_bad_frame_leaves_nothing_behind(tmp_path: Path, small_segments: None) -> None:
    place = tmp_path / "a"
    with pytest.raises(FrameReadError, match="white"):
        build_map([*frames(20), WHITE, *frames(3)], FakeTechnique(), path=place)
    assert not list(tmp_path.iterdir())
    route = build_map(frames(4), FakeTechnique(), path=place)
    before, files = snapshot(route), everything_in(tmp_path)
    with pytest.raises(FrameReadError, match="white"):
        route.extend([*frames(20), WHITE])
    with pytest.raises(FrameReadError, match="white"):
        build_map([*frames(20), WHITE], FakeTechnique(), path=place, overwrite=True)
    assert everything_in(tmp_path) == files
    assert snapshot(route) == snapshot(load_map(place)) == before


def test_errors_of_a_technique_are_not_called_errors_of_the_disk(tmp_path: Path) -> None:
    class Broken(FakeTechnique):
        def describe(self, image: Any) -> Any:
            raise OSError("the technique's own")

    with pytest.raises(OSError, match="the technique's own"):
        build_map(frames(3), Broken(), path=tmp_path / "a")
    assert not list(tmp_path.iterdir())


def test_other_parameters_are_named(tmp_path: Path) -> None:
    route = build_map(frames(3), FakeTechnique(), path=tmp_path / "a")
    other = FakeTechnique(FakeParameters(gain=2))
    expected = (
        r"made with fake\(size=8, gain=1\.0\) version 3, "
        r"you asked for fake\(size=8, gain=2\) version 3; build the map again"
    )
    with pytest.raises(MapError, match=expected):
        load_map(tmp_path / "a", technique=other)
    with pytest.raises(MapError, match=expected):
        route.check_technique(other)
    route.check_technique(FakeTechnique())
    mine = FakeTechnique()
    assert load_map(tmp_path / "a", technique=mine).technique is mine


def test_another_version_of_the_technique_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_map(frames(3), FakeTechnique(), path=tmp_path / "a")
    monkeypatch.setattr(FakeTechnique, "version", 4)
    with pytest.raises(MapError, match=r"made with fake\(.*\) version 3, this program has .* 4; "):
        load_map(tmp_path / "a")


def test_a_technique_that_is_not_installed_is_named(tmp_path: Path) -> None:
    class Unlisted(FakeTechnique):
        name = "unlisted"

    build_map(frames(3), Unlisted(), path=tmp_path / "a")
    with pytest.raises(MapError, match=r"made with unlisted\(.*this program lacks: unknown tech"):
        load_map(tmp_path / "a")
    assert len(load_map(tmp_path / "a", technique=Unlisted())) == 3


def test_other_arrays_of_the_same_technique_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_map(frames(3), FakeTechnique(), path=tmp_path / "a")
    other = FakeTechnique()
    monkeypatch.setattr(other, "layout", FakeTechnique(FakeParameters(size=9)).layout)
    with pytest.raises(MapError, match="but its arrays are"):
        load_map(tmp_path / "a", technique=other)


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no such map"):
        load_map(tmp_path / "a")


def test_progress_watches_frames_and_segments(tmp_path: Path, small_segments: None) -> None:
    seen: list[tuple[str, int, int]] = []

    def progress(items: Iterable[Any], *, total: int, label: str) -> Iterable[Any]:
        count = 0
        for item in items:
            count += 1
            yield item
        seen.append((label, total, count))

    route = build_map(frames(7), FakeTechnique(), path=tmp_path / "a", progress=progress)
    n_segments = route.info()["n_segments"]
    route.save(tmp_path / "b", progress=progress)
    load_map(tmp_path / "b", progress=progress)
    assert seen == [
        ("describing with fake", 7, 7),
        ("saving the map", n_segments, n_segments),
        ("reading the map", n_segments, n_segments),
    ]


def test_relative_paths_are_not_lost_by_going_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    route = build_map(frames(2), FakeTechnique(), path="a.map")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    route.extend(frames(1))
    assert len(load_map(tmp_path / "a.map")) == 3


def test_a_link_to_a_map_is_followed(tmp_path: Path) -> None:
    build_map(frames(2), FakeTechnique(), path=tmp_path / "real.map")
    (tmp_path / "link.map").symlink_to("real.map")
    load_map(tmp_path / "link.map").extend(frames(1))
    assert (tmp_path / "link.map").is_symlink()
    assert len(load_map(tmp_path / "real.map")) == 3


def test_threads_of_one_program_are_kept_apart_too(tmp_path: Path) -> None:
    build_map(frames(2), FakeTechnique(), path=tmp_path / "a")
    inside, go_on = threading.Event(), threading.Event()

    class Waiting(FakeTechnique):
        def describe(self, image: Any) -> Any:
            inside.set()
            go_on.wait(60)
            return super().describe(image)

    slow = load_map(tmp_path / "a", technique=Waiting())
    growing = threading.Thread(target=slow.extend, args=(frames(1, first=2),))
    growing.start()
    assert inside.wait(60)
    with pytest.raises(MapError, match="another process is writing this map"):
        load_map(tmp_path / "a").extend(frames(1))
    go_on.set()
    growing.join()
    assert len(load_map(tmp_path / "a")) == 3


def test_repr_says_what_and_where(place: Path | None) -> None:
    route: RouteMap = build_map(frames(2), FakeTechnique(), path=place)
    assert repr(route) == f"RouteMap(2 frames, fake, {place or 'in memory'})"
