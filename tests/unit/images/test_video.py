"""Videos made on the spot with OpenCV; every frame carries its number in black and white."""

import itertools
import random
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from retraverse.errors import FrameReadError
from retraverse.images import Traverse, open_traverse
from retraverse.images import video as video_module
from retraverse.types import ImageArray

N_FRAMES, N_BITS = 40, 6
MakeVideo = Callable[..., Path]


@pytest.fixture
def make_video(tmp_path: Path) -> MakeVideo:
    def write(name: str = "drive.avi", codec: str = "MJPG", *, fps: float = 10) -> Path:
        path = tmp_path / name
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, (64, 48))
        if not writer.isOpened():
            pytest.skip(f"this OpenCV cannot write {codec} videos")
        for number in range(N_FRAMES):
            writer.write(numbered_picture(number))
        writer.release()
        return path

    return write


def numbered_picture(number: int) -> ImageArray:
    """Return a BGR picture: a red sky above the bits of a number, the lowest one left."""
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[:16] = (0, 0, 255)
    for bit in range(N_BITS):
        picture[16:, bit * 10 : bit * 10 + 10] = 255 * (number >> bit & 1)
    return picture


def number_in(picture: ImageArray) -> int:
    """Return the number that a decoded frame carries."""
    return sum((picture[32, bit * 10 + 5, 1] > 127) << bit for bit in range(N_BITS))


def numbers(traverse: Traverse) -> list[int]:
    return [number_in(frame.colour()) for frame in traverse]


@pytest.mark.parametrize(
    ("name", "codec"), [("a.avi", "MJPG"), ("b.mp4", "mp4v"), ("c.avi", "XVID"), ("d.mkv", "MJPG")]
)
def test_all_frames_in_order_with_times(name: str, codec: str, make_video: MakeVideo) -> None:
    path = make_video(name, codec)
    traverse = open_traverse(path)
    assert (traverse.name, traverse.source) == (name, f"video {path} ({N_FRAMES} frames)")
    assert numbers(traverse) == numbers(traverse) == list(range(N_FRAMES))
    times = [frame.timestamp_s for frame in traverse]
    np.testing.assert_allclose(np.asarray(times, float), np.arange(N_FRAMES) / 10, atol=1e-3)
    first = traverse[0]
    assert (first.name, first.path, first.encoded()) == (f"{name}#000000", None, None)


def test_pixels_are_right_side_up_and_in_rgb(make_video: MakeVideo) -> None:
    frame = open_traverse(make_video())[0]
    assert frame.colour().shape == (48, 64, 3)
    np.testing.assert_allclose(frame.colour()[:8].mean((0, 1)), [255, 0, 0], atol=4)
    # 0.299 of full red.
    np.testing.assert_allclose(frame.grey()[:8].mean(), 76, atol=3)
    np.testing.assert_array_equal(frame.grey("decoder"), frame.grey("from_colour"))
    assert frame.size == (48, 64)


def test_every_third_frame(make_video: MakeVideo) -> None:
    traverse = open_traverse(make_video(), every=3)
    assert numbers(traverse) == list(traverse.indices) == list(range(0, N_FRAMES, 3))
    assert traverse[2].timestamp_s == pytest.approx(0.6)


@pytest.mark.parametrize("kept_frames", [1, 4, 64])
def test_any_order_gives_the_right_frames(
    kept_frames: int, make_video: MakeVideo, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video_module, "_KEPT_FRAMES", kept_frames)
    traverse = open_traverse(make_video("b.mp4", "mp4v"), every=2)
    rng = random.Random(3)
    for index in rng.choices(range(len(traverse)), k=25):
        assert number_in(traverse[index].colour()) == 2 * index


def test_what_is_kept_has_a_limit(make_video: MakeVideo, monkeypatch: pytest.MonkeyPatch) -> None:
    bytes_per_frame = 48 * 64 * 3
    monkeypatch.setattr(video_module, "_KEPT_BYTES", 5 * bytes_per_frame)
    reader = video_module.VideoReader(make_video())
    for index in range(N_FRAMES):
        reader.read(index)
    assert sorted(reader._kept) == list(range(N_FRAMES - 5, N_FRAMES))


def test_walking_forwards_decodes_each_frame_once(
    make_video: MakeVideo, monkeypatch: pytest.MonkeyPatch
) -> None:
    traverse = open_traverse(make_video())
    opened = itertools.count()
    capture = video_module._capture

    def counting(path: Path) -> "cv2.VideoCapture":
        next(opened)
        return capture(path)

    monkeypatch.setattr(video_module, "_capture", counting)
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda frame: number_in(frame.colour()), traverse)) == list(
            range(N_FRAMES)
        )
    assert next(opened) == 1


def test_a_truncated_video_gives_what_it_has_and_says_so(make_video: MakeVideo) -> None:
    path = make_video()
    encoded = path.read_bytes()
    path.write_bytes(encoded[: len(encoded) * 6 // 10])
    with pytest.warns(UserWarning, match=f"of {N_FRAMES} announced frames: truncated"):
        traverse = open_traverse(path)
    assert 5 < len(traverse) < N_FRAMES
    assert f"({len(traverse)} of {N_FRAMES} announced frames: truncated?)" in traverse.source
    assert numbers(traverse) == list(range(len(traverse)))


@pytest.mark.parametrize("name", ["drive.mp4", "drive_0001.dat", "drive.bin"])
def test_what_is_no_video_is_refused_in_silence(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(random.Random(1).randbytes(3000))
    # In a process of its own: FFmpeg fixes its log level when OpenCV first needs it.
    code = "import sys, retraverse.images as i\ntry: i.open_traverse(sys.argv[1])\n"
    code += "except i.frame.FrameReadError as error: print(error)"
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert re.search(f"cannot read .*{name}: OpenCV finds no video", done.stdout)
    assert done.stderr == ""


def test_a_video_without_its_index_is_refused(make_video: MakeVideo) -> None:
    path = make_video("b.mp4", "mp4v")
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(FrameReadError, match=r"truncated \.mp4 has lost its index"):
        open_traverse(path)


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "drive.mp4").write_bytes(b"")
    with pytest.raises(FrameReadError, match=r"drive\.mp4: the file is empty"):
        open_traverse(tmp_path / "drive.mp4")


def test_a_video_that_shrinks_or_goes_while_it_is_read(make_video: MakeVideo) -> None:
    path = make_video()
    traverse = open_traverse(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(FrameReadError, match=r"cannot read drive\.avi#000039: the video now ends"):
        traverse[39].colour()
    path.unlink()
    with pytest.raises(FrameReadError, match=r"drive\.avi#000001: OpenCV finds no video"):
        open_unread(traverse)[1].colour()
    with pytest.raises(FrameReadError, match="No such file"):
        traverse.content_hash()


def open_unread(traverse: Traverse) -> Traverse:
    """Forget what the traverse's reader has kept and opened."""
    pixels = traverse[0].pixels
    assert isinstance(pixels, video_module._VideoPixels)
    pixels.reader._capture = None
    pixels.reader._kept.clear()
    return traverse


def test_content_hash_follows_the_file_and_the_frames(make_video: MakeVideo) -> None:
    one, same, other = make_video("a.avi"), make_video("b.avi"), make_video("c.avi", fps=20)
    for path in (same, other):
        path.replace(path.parent / "moved")
        (path.parent / f"{path.stem}_").mkdir()
        (path.parent / "moved").replace(path.parent / f"{path.stem}_" / "a.avi")
    folder = one.parent
    hashes = [
        open_traverse(source, every=every).content_hash()
        for source, every in [
            (one, 1),
            (folder / "b_" / "a.avi", 1),
            (folder / "c_" / "a.avi", 1),
            (one, 2),
        ]
    ]
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 3


def test_times_that_do_not_rise_come_from_the_frame_rate() -> None:
    assert video_module._Scan([0.0, 40.0, 81.0], 3, 25).times_s() == [0, 0.04, 0.081]
    assert video_module._Scan([0.0, 0.0, 0.0], 3, 25).times_s() == [0, 0.04, 0.08]
    assert video_module._Scan([0.0, 0.0], 2, 0).times_s() == [None, None]
    assert video_module._Scan([0.0], 1, 0).times_s() == [0]
