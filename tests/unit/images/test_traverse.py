import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from retraverse.errors import FrameReadError, InputError, ShapeError
from retraverse.images import Frame, SkippedFrame, Traverse, open_traverse

MakeFolder = Callable[..., Path]


class Watcher:
    """Counts what passes through a progress bar."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int, int]] = []

    def __call__(self, items: Iterable[Any], *, total: int, label: str) -> Iterable[Any]:
        listed = list(items)
        self.seen.append((label, total, len(listed)))
        return listed


@pytest.fixture
def traverse(make_folder: MakeFolder) -> Traverse:
    return open_traverse(make_folder(*(f"{i}.png" for i in range(12))))


def test_it_is_a_sequence_of_frames(traverse: Traverse) -> None:
    assert len(traverse) == 12
    names = [frame.name for frame in traverse]
    assert names == [frame.name for frame in traverse] == [f"{i}.png" for i in range(12)]
    assert traverse[0] in traverse
    assert traverse[-1] == traverse[np.int64(11)] == traverse[11]
    assert [frame.name for frame in reversed(traverse)] == names[::-1]
    with pytest.raises(IndexError):
        traverse[12]


def test_slices_are_traverses_that_keep_the_source_numbers(traverse: Traverse) -> None:
    part = traverse[3:9:2]
    assert isinstance(part, Traverse)
    np.testing.assert_array_equal(part.indices, [3, 5, 7])
    assert part.indices.dtype == np.int64
    assert part[0] == traverse[3]
    assert part.name == traverse.name
    assert part.source == f"{traverse.source}[3:9:2]"
    assert traverse[:2].source.endswith("[:2]")
    assert len(traverse[5:5]) == 0


def test_thinning(traverse: Traverse) -> None:
    np.testing.assert_array_equal(traverse.thinned(5).indices, [0, 5, 10])
    assert traverse.thinned(5).source == f"{traverse.source}, 1 frame of every 5"
    assert traverse.thinned(1) is traverse


def test_frames_show_what_is_in_the_files(traverse: Traverse) -> None:
    assert [int(frame.grey()[0, 0]) for frame in traverse] == list(range(12))


def test_content_hash_is_that_of_names_and_bytes(traverse: Traverse) -> None:
    parts = []
    for frame in traverse:
        assert frame.path is not None
        parts += [frame.name.encode(), frame.path.read_bytes()]
    joined = b"".join(hashlib.sha256(part).digest() for part in parts)
    assert traverse.content_hash() == hashlib.sha256(joined).hexdigest()


def test_content_hash_tells_contents_names_and_order_apart(make_folder: MakeFolder) -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(4, 6)
    arrays = [picture, picture.T.copy(), picture[::-1]]
    hashes = {
        open_traverse(arrays).content_hash(),
        open_traverse(arrays[::-1]).content_hash(),
        open_traverse(arrays[:2]).content_hash(),
        open_traverse([np.dstack([a] * 3) for a in arrays]).content_hash(),
        open_traverse([a.reshape(6, 4) for a in arrays]).content_hash(),
        open_traverse(make_folder("1.png")).content_hash(),
        open_traverse(make_folder("2.png", folder="b")).content_hash(),
    }
    assert len(hashes) == 7
    elsewhere = make_folder("1.png", folder="elsewhere")
    assert open_traverse(elsewhere).content_hash() in hashes


def test_content_hash_shows_progress(traverse: Traverse) -> None:
    watcher = Watcher()
    assert traverse.content_hash(watcher) == traverse.content_hash()
    assert watcher.seen == [("hashing drive", 12, 12)]


def test_bad_frames_are_skipped_counted_and_told(make_folder: MakeFolder) -> None:
    folder = make_folder(*(f"{i}.png" for i in range(5)))
    (folder / "1.png").write_bytes(b"")
    (folder / "3.png").write_bytes((folder / "3.png").read_bytes()[:40])
    watcher = Watcher()
    traverse = open_traverse(folder, skip_bad=True, progress=watcher)
    np.testing.assert_array_equal(traverse.indices, [0, 2, 4])
    assert traverse.skipped[0] == SkippedFrame("1.png", 1, "the file is empty")
    assert (traverse.skipped[1].name, traverse.skipped[1].index) == ("3.png", 3)
    assert "truncated" in traverse.skipped[1].reason
    assert traverse.source == f"folder {folder} (5 pictures), 2 skipped"
    assert watcher.seen == [("checking drive", 5, 5)]
    assert traverse[:1].skipped == traverse.skipped


def test_only_the_frames_that_are_kept_are_checked(make_folder: MakeFolder) -> None:
    folder = make_folder("0.png", "1.png", "2.png")
    (folder / "1.png").write_bytes(b"")
    assert open_traverse(folder, every=2, skip_bad=True).skipped == ()


def test_without_skipping_a_bad_frame_raises_when_it_is_read(make_folder: MakeFolder) -> None:
    folder = make_folder("0.png", "1.png")
    (folder / "1.png").write_bytes(b"")
    traverse = open_traverse(folder)
    assert traverse.skipped == ()
    assert traverse[0].grey().shape == (8, 12)
    with pytest.raises(FrameReadError, match=r"cannot read .*drive/1\.png: the file is empty"):
        traverse[1].grey()


def test_bad_arrays_are_skipped_too(scene: np.ndarray[Any, Any]) -> None:
    traverse = open_traverse([scene, scene / 255, None, scene], skip_bad=True)
    np.testing.assert_array_equal(traverse.indices, [0, 3])
    assert [skipped.name for skipped in traverse.skipped] == ["000001", "000002"]


def test_no_frame_left_is_an_error(make_folder: MakeFolder) -> None:
    folder = make_folder("0.png", "1.png")
    for path in folder.iterdir():
        path.write_bytes(b"")
    with pytest.raises(FrameReadError, match=r"none of 2 frames.*first, 0\.png: the file is empty"):
        open_traverse(folder, skip_bad=True)


def test_skipping_again_keeps_what_was_skipped_before(make_folder: MakeFolder) -> None:
    folder = make_folder("0.png", "1.png", "2.png")
    (folder / "1.png").write_bytes(b"")
    once = open_traverse(folder, skip_bad=True)
    (folder / "2.png").unlink()
    twice = open_traverse(once, skip_bad=True)
    assert [skipped.name for skipped in twice.skipped] == ["1.png", "2.png"]
    np.testing.assert_array_equal(twice.indices, [0])


def test_frames_outlive_their_traverse(make_folder: MakeFolder) -> None:
    frames: list[Frame] = list(open_traverse(make_folder("0.png", "1.png")))
    assert frames[1].grey().max() == 1


def test_taken_frames_come_in_the_order_asked_for(traverse: Traverse) -> None:
    taken = traverse[2:].take([5, 0, 0, 3])
    np.testing.assert_array_equal(taken.indices, [7, 2, 2, 5])
    assert [frame.name for frame in taken] == ["7.png", "2.png", "2.png", "5.png"]
    assert taken.name == traverse.name
    assert taken.source == f"{traverse[2:].source}, 4 frames taken by number"
    assert len(traverse.take([])) == 0
    assert traverse.take(np.arange(12)).frames == traverse.frames


@pytest.mark.parametrize("frames", [[12], [-1], [0, 99]])
def test_frames_outside_the_traverse_cannot_be_taken(traverse: Traverse, frames: list[int]) -> None:
    with pytest.raises(InputError, match="expected 0 to 11"):
        traverse.take(frames)


@pytest.mark.parametrize("frames", [[0.5], [[1, 2]], 3, [True, False]])
def test_only_frame_numbers_can_be_taken(traverse: Traverse, frames: Any) -> None:
    with pytest.raises(ShapeError, match="whole numbers of one axis"):
        traverse.take(frames)
