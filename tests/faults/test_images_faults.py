"""Damaged, missing and forbidden pictures: one clear `FrameReadError`, or a picture; no more."""

import io
import os
import random
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from retraverse.errors import FrameReadError
from retraverse.images import Frame, open_traverse
from retraverse.types import ImageArray


def scene() -> ImageArray:
    y, x = np.mgrid[0:40, 0:56]
    return np.dstack([4 * x, 6 * y, 2 * (x + y)]).astype(np.uint8)


def encode(kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(scene()).save(buffer, kind, **options)
    return buffer.getvalue()


FILES = {kind: encode(kind) for kind in ("JPEG", "PNG", "WEBP", "BMP", "PPM", "TIFF")}
JPEG, PNG, WEBP, BMP, PPM, TIFF = FILES.values()


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("empty.jpg", b"", "the file is empty"),
        ("head.jpg", JPEG[:2], "truncated"),
        ("most.jpg", JPEG[: len(JPEG) * 3 // 4], "truncated .*JPEG end mark is missing"),
        ("tail.jpg", JPEG[:-2], "truncated .*JPEG end mark is missing"),
        ("zeros.jpg", JPEG[:-40] + bytes(40), "truncated .*JPEG end mark is missing"),
        ("header.jpg", JPEG[:200], "truncated .*before its pixels begin"),
        ("half.png", PNG[: len(PNG) // 2], "truncated .*PNG end chunk is missing"),
        ("zeros.png", PNG[:-100] + bytes(100), "damaged PNG data: wrong checksum"),
        ("half.webp", WEBP[: len(WEBP) // 2], "WebP data, or truncated"),
        ("half.bmp", BMP[: len(BMP) // 2], "BMP data, or truncated"),
        ("half.ppm", PPM[: len(PPM) // 2], "PPM or PGM data, or truncated"),
        ("half.tif", TIFF[: len(TIFF) // 2], "TIFF data, truncated"),
        ("zeros.jpg", bytes(5000), "not a picture OpenCV knows"),
        ("text.jpg", b"hello, this is no picture", "not a picture OpenCV knows"),
        ("page.jpg", b"<html>404 Not Found</html>", "a web page"),
        ("pointer.jpg", b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        ("photo.jpg", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC"),
    ],
)
def test_a_bad_file_is_named_with_its_reason(
    name: str, content: bytes, reason: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "good.png").write_bytes(PNG)
    (tmp_path / name).write_bytes(content)
    frame = Frame.from_file(tmp_path / name)
    for read in (frame.grey, partial(frame.grey, "from_colour"), frame.colour):
        with pytest.raises(FrameReadError, match=f"^cannot read .*{name}: .*{reason}") as caught:
            read()
        assert "\n" not in str(caught.value)
    skipped = open_traverse(tmp_path, skip_bad=True).skipped
    assert [bad.name for bad in skipped] == [name]
    assert capfd.readouterr().err == ""


def test_a_file_that_goes_after_the_listing(tmp_path: Path) -> None:
    (tmp_path / "1.png").write_bytes(PNG)
    traverse = open_traverse(tmp_path)
    (tmp_path / "1.png").unlink()
    for read in (traverse[0].grey, traverse[0].encoded, traverse.content_hash):
        with pytest.raises(FrameReadError, match=r"1\.png: no such file \(or gone since"):
            read()


def test_a_link_to_nowhere_is_told_not_passed_over(tmp_path: Path) -> None:
    (tmp_path / "1.png").symlink_to(tmp_path / "elsewhere.png")
    (tmp_path / "2.png").write_bytes(PNG)
    assert len(open_traverse(tmp_path)) == 2
    assert [bad.name for bad in open_traverse(tmp_path, skip_bad=True).skipped] == ["1.png"]


def test_a_folder_in_a_list_of_files(tmp_path: Path) -> None:
    with pytest.raises(FrameReadError, match="a folder, not a picture"):
        open_traverse([tmp_path])[0].grey()


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (PermissionError(13, "Permission denied"), "permission denied"),
        (OSError(5, "Input/output error"), "Input/output error"),
        (OSError("odd"), "odd"),
    ],
)
def test_what_the_disk_answers_is_told(
    error: OSError, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path) -> bytes:
        raise error

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(FrameReadError, match=rf"1\.png: {reason}"):
        Frame.from_file(tmp_path / "1.png").grey()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_permission_denied(tmp_path: Path) -> None:
    path = tmp_path / "1.png"
    path.write_bytes(PNG)
    path.chmod(0)
    with pytest.raises(FrameReadError, match=r"1\.png: permission denied"):
        Frame.from_file(path).grey()


@pytest.mark.heavy
@pytest.mark.parametrize("seed", [20])
@pytest.mark.parametrize("kind", FILES)
def test_random_damage_gives_a_picture_or_a_frame_read_error(
    kind: str, seed: int, tmp_path: Path, scaled: Callable[[int], int]
) -> None:
    rng = random.Random(seed)
    path = tmp_path / "picture"
    frame = Frame.from_file(path)
    messages = []
    for _ in range(scaled(1000)):
        path.write_bytes(damaged(FILES[kind], rng))
        for read in (frame.grey, frame.colour):
            try:
                assert read().dtype == np.uint8
            except FrameReadError as error:
                messages.append(str(error))
    assert messages
    assert not any("\n" in message for message in messages)


def damaged(encoded: bytes, rng: random.Random) -> bytes:
    """Cut the file, or flip some bits, mostly near its head where the structure is."""
    if rng.random() < 0.3:
        return encoded[: rng.randrange(len(encoded))]
    changed = bytearray(encoded)
    for _ in range(rng.randint(1, 8)):
        end = len(changed) if rng.random() < 0.5 else min(len(changed), 300)
        changed[rng.randrange(end)] ^= 1 << rng.randrange(8)
    return bytes(changed)


@pytest.mark.heavy
@pytest.mark.parametrize("seed", [20])
def test_no_truncated_jpeg_or_png_ever_becomes_a_picture(
    seed: int, tmp_path: Path, scaled: Callable[[int], int]
) -> None:
    rng = random.Random(seed)
    path = tmp_path / "picture"
    for encoded in (JPEG, PNG, encode("JPEG", progressive=True), encode("PNG", optimize=True)):
        for length in rng.sample(range(len(encoded)), min(scaled(1000), len(encoded))):
            path.write_bytes(encoded[:length])
            with pytest.raises(FrameReadError):
                Frame.from_file(path).grey()
