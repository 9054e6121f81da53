import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from retraverse.errors import ConfigError, DataMissingError, InputError, ShapeError
from retraverse.images import Traverse, open_traverse
from retraverse.types import ImageArray

MakeFolder = Callable[..., Path]


def names(traverse: Traverse) -> list[str]:
    return [frame.name for frame in traverse]


def test_import_loads_neither_opencv_nor_pillow() -> None:
    code = "import sys, retraverse.images; print({'cv2', 'PIL'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


# --- folders


def test_a_folder_in_natural_order(make_folder: MakeFolder) -> None:
    folder = make_folder("10.png", "2.png", "1.png")
    traverse = open_traverse(folder)
    assert names(traverse) == ["1.png", "2.png", "10.png"]
    assert (traverse.name, traverse.source) == ("drive", f"folder {folder} (3 pictures)")
    assert [frame.index for frame in traverse] == [0, 1, 2]
    assert [frame.path for frame in traverse] == [folder / name for name in names(traverse)]


def test_the_name_is_the_folders_however_it_is_written(
    make_folder: MakeFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_folder("1.png")
    assert open_traverse(f"{folder}/").name == "drive"
    monkeypatch.chdir(folder)
    assert open_traverse(".").name == "drive"


def test_other_and_hidden_files_are_passed_over(make_folder: MakeFolder) -> None:
    folder = make_folder("1.PNG", "2.Png", ".hidden.png", "._1.png", "sub/3.png")
    for other in ("poses.csv", "notes.txt", ".DS_Store", "Thumbs.db"):
        (folder / other).write_text("x")
    (folder / "folder.png").mkdir()
    assert names(open_traverse(folder)) == ["1.PNG", "2.Png"]


@pytest.mark.parametrize(
    ("files", "part"),
    [
        ([], "found nothing, expected names ending in .bmp"),
        (["a.txt", "b.txt", "c.csv"], r"found 2 \.txt files, 1 \.csv file, expected"),
        (["README"], "1 suffixless file"),
        (["autumn/1.png", "snow/1.png"], r"found 2 folders: did you mean autumn/ or snow/\?"),
        (["a.txt", "10/1.png", "9/1.png"], r"1 \.txt file, 2 folders: did you mean 9/ or 10/\?"),
        ([".hidden.png"], "found nothing"),
    ],
)
def test_a_folder_without_pictures_says_what_is_there(
    files: list[str], part: str, make_folder: MakeFolder
) -> None:
    folder = make_folder(*files)
    with pytest.raises(DataMissingError, match=f"no pictures directly in this folder; .*{part}"):
        open_traverse(folder)


def test_nothing_there_suggests_what_looks_like_it(make_folder: MakeFolder) -> None:
    folder = make_folder("1.png", folder="autumn")
    with pytest.raises(DataMissingError, match=r"autum: no such file.*did you mean .*autumn\?"):
        open_traverse(folder.with_name("autum"))
    with pytest.raises(DataMissingError, match=r"no such file or folder$"):
        open_traverse("/nowhere/at/all")


def test_the_home_folder(make_folder: MakeFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = make_folder("1.png", "~odd.png")
    monkeypatch.setenv("HOME", str(folder.parent))
    assert len(open_traverse("~/drive")) == 2
    assert len(open_traverse("~/drive/*.png")) == 2
    monkeypatch.chdir(folder)
    assert len(open_traverse("~odd.png")) == 1


# --- patterns and single files


def test_a_pattern_in_natural_order_over_folders(make_folder: MakeFolder, tmp_path: Path) -> None:
    make_folder("run10/1.png", "run2/10.png", "run2/9.png", "run2/pose.png.txt")
    pattern = f"{tmp_path}/drive/run*/*"
    traverse = open_traverse(pattern)
    assert names(traverse) == ["9.png", "10.png", "1.png"]
    assert (traverse.name, traverse.source) == ("drive", f"pattern {pattern} (3 pictures)")


def test_frames_of_one_file_name_are_told_apart_by_their_folders(
    make_folder: MakeFolder, tmp_path: Path
) -> None:
    make_folder("a/1.png", "b/1.png", "b/2.png")
    expected = ["a/1.png", "b/1.png", "b/2.png"]
    assert names(open_traverse(f"{tmp_path}/**/*.png")) == expected
    assert names(open_traverse([f"{tmp_path}/drive/{name}" for name in expected])) == expected


def test_a_pattern_relative_to_here(
    make_folder: MakeFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(make_folder("1.png", "2.png"))
    traverse = open_traverse("[12].png")
    assert (traverse.name, names(traverse)) == ("drive", ["1.png", "2.png"])


def test_what_exists_is_no_pattern(make_folder: MakeFolder, tmp_path: Path) -> None:
    make_folder("1.png", "2.png", folder="run[1]")
    make_folder("1.png", folder="run1")
    assert len(open_traverse(tmp_path / "run[1]")) == 2


def test_a_pattern_without_pictures_says_what_matches(
    make_folder: MakeFolder, tmp_path: Path
) -> None:
    make_folder("a/1.png", "notes.txt")
    with pytest.raises(DataMissingError, match=r"found 1 folder: did you mean .*drive/a/\?"):
        open_traverse(f"{tmp_path}/drive/a*")
    with pytest.raises(DataMissingError, match=r"no pictures match.*found 1 \.txt file"):
        open_traverse(f"{tmp_path}/drive/*.txt")
    with pytest.raises(DataMissingError, match=r"no pictures match.*found nothing"):
        open_traverse(f"{tmp_path}/*.jpg")


def test_a_single_picture(make_folder: MakeFolder) -> None:
    path = make_folder("1.png") / "1.png"
    traverse = open_traverse(path)
    assert (names(traverse), traverse.name) == (["1.png"], "1")


def test_a_text_file_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_text("\x1b[1m1.png\x1b[0m\n2.png — ok\n")
    with pytest.raises(InputError, match=r"list\.txt: a text file, expected a folder"):
        open_traverse(path)


# --- lists and arrays


def test_a_list_of_paths_keeps_its_order_and_takes_any_suffix(make_folder: MakeFolder) -> None:
    folder = make_folder("10.png", "2.png", "1.dat")
    for paths in ([folder / "10.png", folder / "2.png", folder / "1.dat"],):
        for source in (paths, tuple(paths), [str(p) for p in paths], np.array(paths, str)):
            traverse = open_traverse(source)
            assert names(traverse) == ["10.png", "2.png", "1.dat"]
            assert [int(frame.grey().max()) for frame in traverse] == [0, 1, 2]
            assert (traverse.name, traverse.source) == ("drive", "list of 3 files")


def test_one_path_twice(make_folder: MakeFolder) -> None:
    path = make_folder("1.png") / "1.png"
    assert names(open_traverse([path, path])) == ["1.png", "1.png"]


def test_a_list_of_arrays_of_different_sizes(scene: ImageArray) -> None:
    traverse = open_traverse([scene, scene[:20, :30], scene[:, :, 0]])
    assert [frame.size for frame in traverse] == [(48, 64), (20, 30), (48, 64)]
    assert names(traverse) == ["000000", "000001", "000002"]
    assert all(frame.path is None for frame in traverse)


def test_a_list_of_both(scene: ImageArray, make_folder: MakeFolder) -> None:
    traverse = open_traverse([make_folder("1.png") / "1.png", scene])
    assert names(traverse) == ["1.png", "000001"]
    assert [frame.size for frame in traverse] == [(8, 12), (48, 64)]


def test_channel_order_of_arrays(scene: ImageArray) -> None:
    traverse = open_traverse([scene[..., ::-1]], colour_order="bgr")
    np.testing.assert_array_equal(traverse[0].colour(), scene)


def test_a_stack_of_frames(scene: ImageArray) -> None:
    grey = np.stack([scene[:, :, i] for i in range(3)])
    for stack in (grey, grey[..., None], np.stack([scene] * 3), np.zeros((3, 9, 9, 4), np.uint16)):
        traverse = open_traverse(stack)
        assert (len(traverse), traverse.source) == (3, "ndarray of 3 arrays")
    np.testing.assert_array_equal(open_traverse(grey)[1].grey(), scene[:, :, 1])


@pytest.mark.parametrize(
    ("stack", "part"),
    [
        (
            np.zeros((48, 64), np.uint8),
            r"got an array of shape \(48, 64\).*one picture goes in a list",
        ),
        (
            np.zeros((48, 64, 3), np.uint8),
            r"got an array of shape \(48, 64, 3\).*one picture goes in a list",
        ),
        (
            np.zeros((2, 2, 48, 64, 3), np.uint8),
            r"got an array of shape \(2, 2, 48, 64, 3\), expected \(frames",
        ),
        (np.zeros((5, 48, 64), np.float32), "got frames of float32, expected uint8"),
        (np.zeros((5, 3, 48, 64), np.uint8), "got frames of shape .*channels first"),
        (np.zeros(5, np.uint8), r"got an array of shape \(5,\)"),
    ],
)
def test_an_array_that_is_no_stack_is_refused_at_once(stack: ImageArray, part: str) -> None:
    with pytest.raises(ShapeError, match=f"source: {part}"):
        open_traverse(stack)


class Simulated:
    """Renders on request and counts how often."""

    name = "winter"

    def __init__(self, n_frames: int) -> None:
        self.n_frames = n_frames
        self.rendered: list[int] = []

    def __len__(self) -> int:
        return self.n_frames

    def __getitem__(self, index: int) -> ImageArray:
        self.rendered.append(index)
        return np.full((6, 8, 3), index, np.uint8)


def test_a_simulated_drive_stays_lazy() -> None:
    drive = Simulated(1000)
    traverse = open_traverse(drive, every=10)
    assert drive.rendered == []
    assert (traverse.name, len(traverse)) == ("winter", 100)
    assert traverse.source == "Simulated of 1000 arrays, 1 frame of every 10"
    assert int(traverse[7].grey().max()) == 70
    assert drive.rendered == [70]


def test_a_list_that_changes_later_does_not_change_the_traverse(scene: ImageArray) -> None:
    items = [scene, scene]
    traverse = open_traverse(items)
    items.clear()
    assert traverse[1].size == (48, 64)


def test_a_lazy_sequence_of_paths_is_told_what_to_do() -> None:
    class Paths:
        def __len__(self) -> int:
            return 2

        def __getitem__(self, index: int) -> str:
            return f"{index}.png"

    with pytest.raises(ShapeError, match=r"cannot read 000000: text .*pass list"):
        open_traverse(Paths())[0].grey()


def test_a_traverse_passes_through(make_folder: MakeFolder) -> None:
    traverse = open_traverse(make_folder("1.png", "2.png", "3.png"))
    assert open_traverse(traverse) is traverse
    np.testing.assert_array_equal(open_traverse(traverse[1:], every=2).indices, [1])


def test_every_keeps_the_numbers_of_the_source(make_folder: MakeFolder) -> None:
    folder = make_folder(*(f"{i}.png" for i in range(7)))
    traverse = open_traverse(folder, every=3)
    np.testing.assert_array_equal(traverse.indices, [0, 3, 6])
    assert names(traverse) == ["0.png", "3.png", "6.png"]


def generated() -> Iterator[str]:
    yield "1.png"


@pytest.mark.parametrize(
    ("source", "error", "part"),
    [
        ([], DataMissingError, "the list is empty"),
        ((), DataMissingError, "the list is empty"),
        (np.zeros((0, 4, 5), np.uint8), DataMissingError, "the sequence is empty"),
        ("", InputError, "empty path"),
        (None, InputError, "got NoneType, expected a folder"),
        (7, InputError, "got int"),
        ({1: 2}, InputError, "got dict"),
        (b"abc", InputError, "got bytes"),
        (generated(), InputError, r"got generator.*pass list\(\.\.\.\)"),
        ("/dev/null", InputError, "a device or pipe"),
        ("x" * 5000, DataMissingError, "cannot be looked up"),
        ("a\0b", DataMissingError, "no such file"),
    ],
)
def test_what_is_no_source_is_refused(source: Any, error: type[Exception], part: str) -> None:
    with pytest.raises(error, match=part):
        open_traverse(source)


@pytest.mark.parametrize("every", [0, -1, 1.5, "2", True, None])
def test_every_must_be_a_whole_number(every: Any, scene: ImageArray) -> None:
    with pytest.raises(ConfigError, match=r"every: got .*, expected a whole number"):
        open_traverse([scene], every=every)


def test_an_unknown_channel_order_is_refused(scene: ImageArray) -> None:
    with pytest.raises(ConfigError, match="colour_order: got 'rbg', expected one of rgb, bgr"):
        open_traverse([scene], colour_order="rbg")  # type: ignore[arg-type]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may list everything")
def test_a_folder_that_may_not_be_listed(make_folder: MakeFolder) -> None:
    folder = make_folder("1.png")
    folder.chmod(0)
    try:
        with pytest.raises(DataMissingError, match="cannot be listed: Permission denied"):
            open_traverse(folder)
    finally:
        folder.chmod(0o700)
