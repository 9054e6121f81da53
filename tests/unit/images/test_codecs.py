import os
import random
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError, InputError, MissingExtraError, ShapeError
from retraverse.images.codecs import GROUP_CODECS, CodecName, decode_group, encode_group
from retraverse.types import ImageArray

CODECS: tuple[CodecName, ...] = ("h265", "av1")


@pytest.fixture(autouse=True)
def _with_the_extra(request: pytest.FixtureRequest) -> None:
    if "without" not in request.node.name:
        pytest.importorskip("av", reason="the extra 'video' is not installed")


def moving_street(n: int = 4, height: int = 72, width: int = 90, seed: int = 3) -> list[ImageArray]:
    """Return pictures of one texture that shifts by two pixels a frame."""
    random_texture = np.random.default_rng(seed).integers(
        0, 256, (height, width + 2 * n, 3), dtype=np.uint8
    )
    wide = np.asarray(cv2.GaussianBlur(random_texture, (0, 0), 3), np.uint8)
    wide = np.asarray(cv2.normalize(wide, None, 0, 255, cv2.NORM_MINMAX), np.uint8)  # type: ignore[call-overload]
    return [wide[:, 2 * i : 2 * i + width].copy() for i in range(n)]


def psnr(one: ImageArray, other: ImageArray) -> float:
    return float(cv2.PSNR(one, other))


@pytest.mark.parametrize("codec", CODECS)
def test_fine_groups_give_the_pictures_back_in_order(codec: CodecName) -> None:
    pictures = moving_street()
    decoded = decode_group(encode_group(pictures, codec, 1))
    assert len(decoded) == len(pictures)
    for row, picture in enumerate(decoded):
        assert picture.dtype == np.uint8
        assert psnr(picture, pictures[row]) > 35
        likeness = [psnr(picture, other) for other in pictures]
        assert int(np.argmax(likeness)) == row


@pytest.mark.parametrize("codec", CODECS)
def test_bytes_and_fidelity_fall_with_quality(codec: CodecName) -> None:
    pictures = moving_street()
    groups = [encode_group(pictures, codec, quality) for quality in (5, 30, 50)]
    sizes = [len(group) for group in groups]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > 3 * sizes[2]
    fidelity = [psnr(decode_group(group)[1], pictures[1]) for group in groups]
    assert fidelity == sorted(fidelity, reverse=True)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize(("height", "width"), [(64, 64), (54, 97), (17, 5), (120, 160)])
def test_any_size_comes_back(codec: CodecName, height: int, width: int) -> None:
    pictures = moving_street(2, height, width)
    for picture, decoded in zip(
        pictures, decode_group(encode_group(pictures, codec, 8)), strict=True
    ):
        assert decoded.shape == picture.shape
        assert psnr(decoded, picture) > 30


@pytest.mark.parametrize("codec", CODECS)
def test_grey_stays_grey_and_one_picture_is_a_group(codec: CodecName) -> None:
    grey = moving_street()[0][..., 1].copy()
    (decoded,) = decode_group(encode_group([grey], codec, 5))
    assert decoded.shape == grey.shape
    assert psnr(decoded, grey) > 35
    again = decode_group(encode_group([np.full((64, 64), 100, np.uint8)], codec, 5))[0]
    assert abs(int(np.median(again)) - 100) <= 1


@pytest.mark.parametrize("codec", CODECS)
def test_encoding_is_deterministic_and_counts_every_byte(codec: CodecName) -> None:
    pictures = moving_street()
    one = encode_group(pictures, codec, 30)
    assert one == encode_group([picture.copy() for picture in pictures], codec, 30)
    position, n_packets = 12, 0
    while position < len(one):
        position += 3 + int.from_bytes(one[position : position + 3], "big")
        n_packets += 1
    assert position == len(one)
    assert n_packets >= 1


@pytest.mark.parametrize("codec", CODECS)
def test_neighbours_make_a_group_smaller_than_its_pictures_alone(codec: CodecName) -> None:
    still = [moving_street()[0]] * 4
    assert len(encode_group(still, codec, 25)) < 3 * len(encode_group(still[:1], codec, 25))


@pytest.mark.parametrize(
    ("arguments", "error", "reason"),
    [
        (([], "av1", 30), InputError, "got 0, expected 1 to 1000"),
        (([np.zeros((8, 8), np.uint8), np.zeros((8, 9), np.uint8)], "av1", 30), ShapeError, "one"),
        (([np.zeros((8, 8))], "av1", 30), ShapeError, "float64"),
        (([np.zeros((8, 8), np.uint8)], "vp9", 30), ConfigError, "codec: got 'vp9', expected one"),
        (([np.zeros((8, 8), np.uint8)], "av1", 0), ConfigError, "av1: got 0, expected 1 to 63"),
        (([np.zeros((8, 8), np.uint8)], "h265", 52), ConfigError, "h265: got 52, expected 0 to 51"),
        (([np.zeros((8, 8), np.uint8)], "h265", 3.5), ConfigError, "h265: got 3.5"),
    ],
)
def test_what_cannot_be_encoded(arguments: Any, error: type[Exception], reason: str) -> None:
    with pytest.raises(error, match=reason):
        encode_group(*arguments)


def test_bytes_that_are_no_group() -> None:
    group = encode_group(moving_street(2), "av1", 40)
    for content in (b"", b"GOP1", b"\xff" * 40, b"GOP1\x07" + group[5:]):
        with pytest.raises(InputError, match="no group of this program's"):
            decode_group(content)
    with pytest.raises(InputError, match="group of pictures: "):
        decode_group(group[:-1])
    with pytest.raises(InputError, match="got 2 pictures, expected 3"):
        decode_group(group[:10] + b"\x00\x03" + group[12:])


@pytest.mark.parametrize("codec", CODECS)
def test_fuzz_gives_pictures_or_an_input_error(codec: CodecName, scaled: Any) -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    group = encode_group(moving_street(2), codec, 45)
    for _ in range(scaled(200)):
        content = bytearray(group)
        for _ in range(draw.randrange(1, 4)):
            content[draw.randrange(4, len(content))] = draw.randrange(256)
        try:
            decoded = decode_group(bytes(content[: draw.randrange(12, len(content) + 1)]))
        except InputError:
            continue
        assert all(picture.dtype == np.uint8 for picture in decoded)


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'retraverse\[video\]'"):
        encode_group([np.zeros((64, 64), np.uint8)])
    with pytest.raises(MissingExtraError, match="video codecs need PyAV"):
        decode_group(b"")


def test_settings_are_on_record() -> None:
    assert "libx265" in GROUP_CODECS["h265"].label
    assert "lp=1" in GROUP_CODECS["av1"].label


def test_the_environment_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SVT_LOG", "2")
    encode_group(moving_street(1), "av1", 40)
    assert os.environ["SVT_LOG"] == "2"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are seen on Linux alone")
def test_no_thread_is_left_at_real_time_priority() -> None:
    encode_group([np.zeros((64, 64), np.uint8)] * 3, "av1", 40)
    policies = {os.sched_getscheduler(int(task.name)) for task in Path("/proc/self/task").iterdir()}
    assert policies <= {os.SCHED_OTHER, os.SCHED_BATCH, os.SCHED_IDLE}


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("shape", [(64, 64), (50, 98), (98, 50), (72, 90)])
def test_the_same_pictures_give_the_same_bytes(codec: CodecName, shape: tuple[int, int]) -> None:
    pictures = moving_street(12, *shape)
    assert len({encode_group(pictures, codec, 35) for _ in range(12)}) == 1
