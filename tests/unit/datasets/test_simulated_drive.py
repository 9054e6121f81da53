"""Drives: the same pixels whichever way they are asked for, exact truth, whole files."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from retraverse.datasets.simulated import (
    Camera,
    Disturbances,
    SimulatedDrive,
    SimulatedRoute,
    make_street,
    simulate_route,
    write_drive,
)
from retraverse.errors import ConfigError, InputError
from retraverse.images import open_traverse
from retraverse.types import FloatArray, ImageArray

SMALL = Camera(width=96, height=72, supersampling=1)
Route = Callable[..., SimulatedRoute]


@pytest.fixture(scope="module")
def plain(small_route: Route) -> SimulatedRoute:
    """Return a route without any disturbance."""
    return small_route()


@pytest.fixture(scope="module")
def detour() -> SimulatedRoute:
    """Return a route whose query leaves the map for a while."""
    return simulate_route(1, 24, motion="detour", camera=SMALL)


def same(first: ImageArray, second: ImageArray) -> bool:
    """Return whether two pictures are equal in every byte."""
    return first.shape == second.shape and first.tobytes() == second.tobytes()


# Determinism


def test_frames_do_not_depend_on_those_before(small_route: Route) -> None:
    forwards = small_route(night=1.0, traffic=1.0, vibration=1.0).query
    expected = {i: forwards[i] for i in (2, 9, 17)}
    street = make_street(1, 48.0)
    assert street is not forwards.street, "or both drives would share their textures"
    backwards = SimulatedDrive(
        street, forwards.motion, forwards.disturbances, camera=SMALL, seed=forwards.seed
    )
    for i in (17, 2, 9, 2):
        assert same(backwards[i], expected[i]), i


def test_slices_and_loops_give_the_same_frames(plain: SimulatedRoute) -> None:
    drive = plain.query
    part = drive[20:2:-6]
    assert isinstance(part, SimulatedDrive)
    assert part.positions_m.tolist() == [40, 28, 16]
    assert len(part) == len(part.on_route) == 3
    for looped, i in zip(part, (20, 14, 8), strict=True):
        assert same(looped, drive[i])
    assert same(part[-1], drive[8])
    assert same(part[1:][0], drive[14])


def test_pictures_are_what_they_say(plain: SimulatedRoute) -> None:
    frame = plain.query[0]
    assert frame.shape == (72, 96, 3)
    assert frame.dtype == np.uint8
    assert frame.std() > 20
    with pytest.raises(IndexError):
        plain.query[24]


def test_another_seed_is_another_street(plain: SimulatedRoute, small_route: Route) -> None:
    other = small_route(seed=2)
    assert not same(plain.query[3], other.query[3])
    assert plain.query.name != other.query.name


def test_nothing_disturbed_is_nothing_changed(plain: SimulatedRoute) -> None:
    assert plain.reference.positions_m.tolist() == plain.query.positions_m.tolist()
    assert all(same(plain.reference[i], plain.query[i]) for i in range(0, 24, 5))
    assert [list(found) for found in plain.truth(0.0)] == [[i] for i in range(24)]


def test_a_stop_shows_the_same_picture(plain: SimulatedRoute) -> None:
    drive = simulate_route(1, 24, query=Disturbances(stops=1.0), camera=SMALL).query
    standing = np.flatnonzero(np.diff(drive.positions_m) == 0)
    assert len(standing) > 5
    i = int(standing[0])
    assert same(drive[i], drive[i + 1])
    assert same(drive[i], plain.reference[round(drive.positions_m[i] / 2)])


def test_off_the_route_is_another_street(plain: SimulatedRoute, detour: SimulatedRoute) -> None:
    off = np.flatnonzero(~detour.query.on_route)
    assert len(off) > 3
    place = detour.query.motion.places_m[off[0]]
    there = detour.query[int(off[0])].astype(float)
    here = plain.reference[round(place / 2)].astype(float)
    ahead = plain.reference[round(place / 2) + 2].astype(float)
    assert np.abs(there - here).mean() > np.abs(ahead - here).mean()
    assert all(len(detour.truth(1e9)[i]) == 0 for i in off)


# What the camera does


def test_near_things_move_more_than_far_ones() -> None:
    """Points of the road move as a pinhole camera 1.5 m above it moved 0.4 m must see them."""
    import cv2

    route = simulate_route(1, 24, query=Disturbances(lateral_shift=0.25))
    ratios, inner, outer = [], [], []
    for i in range(8, 20, 2):
        first, second = (
            cv2.cvtColor(drive[i], cv2.COLOR_RGB2GRAY) for drive in (route.reference, route.query)
        )
        corners = cv2.goodFeaturesToTrack(first, 300, 0.01, 4)
        moved, found, _ = cv2.calcOpticalFlowPyrLK(first, second, corners, np.empty(0))
        places = corners[found == 1]
        shifts = (moved[found == 1] - places)[:, 0]
        below, aside = places[:, 1] - 0.56 * 240, np.abs(places[:, 0] - 160)
        is_road = (below > 25) & (aside < 110)
        ratios += (shifts / (below * 0.4 / 1.5))[is_road].tolist()
        inner += shifts[aside < 40].tolist()
        outer += shifts[aside > 80].tolist()
    assert len(ratios) > 20
    assert np.median(ratios) == pytest.approx(1.0, rel=0.15)
    assert np.median(outer) > 1.4 * np.median(inner) > 0


def thumbnails(drive: SimulatedDrive) -> FloatArray:
    """Return the frames as grey 64 x 32 vectors of mean 0 and length 1."""
    rows = []
    for picture in drive:
        small = Image.fromarray(picture).convert("L").resize((64, 32))
        row = np.asarray(small, np.float64).ravel()
        rows.append((row - row.mean()) / np.linalg.norm(row - row.mean()))
    return np.array(rows, np.float32)


def test_a_plain_matcher_finds_what_is_plain(plain: SimulatedRoute, small_route: Route) -> None:
    reference = thumbnails(plain.reference)

    def recovered(route: SimulatedRoute) -> float:
        best = (thumbnails(route.query) @ reference.T).argmax(axis=1)
        return float(np.mean([b in true for b, true in zip(best, route.truth(2.0), strict=True)]))

    assert recovered(plain) == 1.0
    assert recovered(small_route(night=1.0, lateral_shift=1.0)) < 0.5


# Truth


def test_truth_lists_all_within_the_radius(small_route: Route) -> None:
    route = simulate_route(
        6, 40, query=Disturbances(speed_change=1.0, stops=0.5, revisits=1.0), motion="detour"
    )
    for radius in (0.0, 2.0, 5.5, 1000.0):
        for position, found in zip(route.query.positions_m, route.truth(radius), strict=True):
            places = route.reference.positions_m
            near = [j for j in range(len(places)) if abs(places[j] - position) <= radius]
            assert found.tolist() == near
            assert found.dtype == np.int64


@pytest.mark.parametrize("radius", [-1.0, float("nan"), float("inf")])
def test_truth_needs_a_radius(plain: SimulatedRoute, radius: float) -> None:
    with pytest.raises(ConfigError, match="radius_m"):
        plain.truth(radius)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("n_frames", 1, "n_frames is 1"),
        ("n_frames", 50001, "n_frames"),
        ("n_frames", 10.5, "n_frames is 10.5.*integer"),
        ("spacing_m", 0.0, "spacing_m is 0.0"),
        ("spacing_m", float("nan"), "spacing_m"),
        ("seed", -1, "seed is -1"),
        ("motion", "sideways", "'sideways'.*forward, backwards, detour, jump"),
    ],
)
def test_a_wrong_argument_is_named(name: str, value: object, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        simulate_route(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("width", 15),
        ("width", 100.5),
        ("height", 5000),
        ("height", "240"),
        ("field_of_view_deg", 180.0),
        ("height_m", float("nan")),
        ("horizon", 0.0),
        ("supersampling", 0),
        ("supersampling", True),
    ],
)
def test_a_wrong_camera_is_named(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"camera {name} is"):
        Camera(**{name: value})  # type: ignore[arg-type]


# Files


def test_names_reach_the_traverse(plain: SimulatedRoute) -> None:
    traverse = open_traverse(plain.query)
    assert traverse.name == plain.query.name
    assert "seed 1" in traverse.name
    assert plain.reference.name != plain.query.name
    assert same(traverse[4].colour(), plain.query[4])


def test_written_files_read_back(plain: SimulatedRoute, tmp_path: Path) -> None:
    drive = plain.query[:4]
    folder = write_drive(drive, tmp_path / "new" / "drive", quality=95)
    names = ["0000.jpg", "0001.jpg", "0002.jpg", "0003.jpg"]
    assert sorted(path.name for path in folder.iterdir()) == [*names, "positions.csv"]
    assert [path.name for path in folder.parent.iterdir()] == ["drive"]
    for name, rendered in zip(names, drive, strict=True):
        read = np.asarray(Image.open(folder / name), float)
        assert np.abs(read - rendered).mean() < 6
    rows = list(csv.DictReader((folder / "positions.csv").read_text("utf-8").splitlines()))
    assert list(rows[0]) == ["frame", "name", "position_m", "on_route"]
    assert [row["frame"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["name"] for row in rows] == names
    assert [float(row["position_m"]) for row in rows] == [0, 2, 4, 6]
    assert {row["on_route"] for row in rows} == {"true"}


def test_off_the_route_the_table_has_no_position(detour: SimulatedRoute, tmp_path: Path) -> None:
    first = int(np.flatnonzero(~detour.query.on_route)[0])
    folder = write_drive(detour.query[first - 1 : first + 1], tmp_path / "drive")
    lines = (folder / "positions.csv").read_text(encoding="utf-8").splitlines()
    assert lines[1].endswith(",true")
    assert lines[2] == "1,0001.jpg,,false"


def test_an_empty_folder_will_do_and_no_other(plain: SimulatedRoute, tmp_path: Path) -> None:
    drive = plain.query[:1]
    write_drive(drive, tmp_path / "a")
    (tmp_path / "b").mkdir()
    assert (write_drive(drive, tmp_path / "b") / "0000.jpg").is_file()
    for taken in (tmp_path / "a", tmp_path / "a" / "0000.jpg"):
        with pytest.raises(InputError, match="not an empty folder"):
            write_drive(drive, taken)


@pytest.mark.parametrize("quality", [0, 101, 90.5, True])
def test_quality_has_a_range(plain: SimulatedRoute, tmp_path: Path, quality: int) -> None:
    with pytest.raises(ConfigError, match="quality"):
        write_drive(plain.query[:1], tmp_path / "drive", quality=quality)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("is_there", [False, True])
def test_a_failure_leaves_nothing_behind(
    plain: SimulatedRoute,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    is_there: bool,
) -> None:
    save = Image.Image.save
    written: list[Path] = []

    def fail_late(picture: Image.Image, path: Path, **options: object) -> None:
        if len(written) == 2:
            raise error
        save(picture, path, **options)  # type: ignore[arg-type]
        written.append(path)

    folder = tmp_path / "drive"
    if is_there:
        folder.mkdir()
    monkeypatch.setattr(Image.Image, "save", fail_late)
    with pytest.raises(type(error)):
        write_drive(plain.query[:4], folder)
    assert len(written) == 2, "the failure came in the middle"
    assert list(tmp_path.rglob("*")) == ([folder] if is_there else [])
    monkeypatch.undo()
    assert len(list(write_drive(plain.query[:2], folder).iterdir())) == 3
