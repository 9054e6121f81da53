"""What is done to pictures beyond JPEG files: single parts of the damage, groups of video."""

import cv2
import numpy as np
import pytest

from retraverse.errors import ConfigError
from retraverse.images import (
    Frame,
    VideoGroups,
    Worsening,
    open_traverse,
    worsen_frame,
    worsen_group,
    worsened,
)
from retraverse.images.codecs import decode_group, encode_group
from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.types import ImageArray


def pictures(n: int = 5, *, grey: bool = False) -> list[ImageArray]:
    """Return a texture that shifts by two pixels a frame."""
    wide = np.random.default_rng(7).integers(0, 256, (70, 80 + 2 * n, 3), np.uint8)
    wide = np.asarray(cv2.GaussianBlur(wide, (0, 0), 2), np.uint8)
    shown = wide[..., 0] if grey else wide
    return [shown[:, 2 * i : 2 * i + 80].copy() for i in range(n)]


@pytest.mark.parametrize("part", JPEG_PARTS)
def test_a_part_is_done_to_the_resized_picture(part: str) -> None:
    picture = pictures(1)[0]
    worse = worsen_frame(Frame.from_array(picture), Worsening(48, "opencv", 97, part=part))
    expected = JPEG_PARTS[part].apply(np.asarray(cv2.resize(picture, (48, 48)), np.uint8), 97)
    np.testing.assert_array_equal(worse.frame.colour(), expected)
    lazy = worsened(open_traverse([picture]), Worsening(48, "opencv", 97, part=part))[0]
    np.testing.assert_array_equal(lazy.colour(), expected)
    assert lazy.encoded() is None
    assert worse.frame.encoded() is None
    assert (worse.n_bytes, worse.compress_s) == (48 * 48 * 3, 0.0)


def test_parts_and_files_have_labels_and_fingerprints_of_their_own() -> None:
    ways = [Worsening(compression=97, part=part) for part in ("", *JPEG_PARTS)]
    ways += [Worsening(video=VideoGroups("h265", 30)), Worsening(video=VideoGroups("av1", 30))]
    ways += [Worsening(video=VideoGroups("h265", 31)), Worsening(video=VideoGroups("h265", 30, 4))]
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    assert len({way.label for way in ways}) == len({way.fingerprint(b"x") for way in ways})
    assert len({way.label for way in ways}) == len(ways)


@pytest.mark.parametrize("grey", [False, True])
@pytest.mark.parametrize("codec", ["h265", "av1"])
def test_a_drive_is_sent_in_whole_groups(codec: str, grey: bool) -> None:
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    drive = pictures(5, grey=grey)
    way = Worsening(video=VideoGroups(codec, 40, length=3))  # type: ignore[arg-type]
    groups = [encode_group(some, codec, 40) for some in (drive[:3], drive[3:])]  # type: ignore[arg-type]
    expected = [picture for group in groups for picture in decode_group(group)]
    frames = open_traverse(drive).frames
    together = [*worsen_group(frames[:3], way), *worsen_group(frames[3:], way)]
    for lazy, made, picture in zip(
        worsened(open_traverse(drive), way), together, expected, strict=True
    ):
        for frame in (lazy, made.frame):
            shown = frame.grey() if grey else frame.colour()
            np.testing.assert_array_equal(shown, picture)
        assert lazy.fingerprint() == made.frame.fingerprint()
    assert sum(one.n_bytes for one in together[:3]) == len(groups[0])
    assert sum(one.n_bytes for one in together[3:]) == len(groups[1])
    assert max(one.n_bytes for one in together[:3]) - min(one.n_bytes for one in together[:3]) <= 1
    alone = worsen_frame(frames[4], way)
    assert alone.n_bytes == len(encode_group(drive[4:], codec, 40))  # type: ignore[arg-type]


def test_a_picture_of_a_group_is_another_beside_other_pictures() -> None:
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    way, drive = Worsening(video=VideoGroups("h265", 40, length=2)), pictures(4)
    other = [drive[0], drive[1] // 2, *drive[2:]]
    one, another = (worsened(open_traverse(shown), way) for shown in (drive, other))
    same = [a.fingerprint() == b.fingerprint() for a, b in zip(one, another, strict=True)]
    assert same == [False, False, True, True]
    assert len({frame.fingerprint() for frame in one}) == 4


def test_a_long_drive_in_groups_is_not_held(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    sent: list[int] = []

    def counted(shown: list[ImageArray], *words: object) -> bytes:
        sent.append(len(shown))
        return encode_group(shown, *words)  # type: ignore[arg-type]

    monkeypatch.setattr("retraverse.images.worsen.encode_group", counted)
    drive = worsened(open_traverse(pictures(12)), Worsening(video=VideoGroups("h265", 40, 2)))
    for _ in range(2):
        for frame in drive:
            frame.grey()
    assert sent.count(2) == 12, "each group is sent once a pass: none of the first pass is left"
    drive[0].grey()
    drive[1].grey()
    assert sent.count(2) == 13


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda: Worsening(compression=90, part="gird"), "did you mean 'grid'"),
        (lambda: Worsening(part="grid"), "got no compression"),
        (
            lambda: VideoGroups("h264"),  # type: ignore[arg-type]
            "unknown video codec: got 'h264'",
        ),
        (lambda: VideoGroups("h265", 52), "expected 0 to 51"),
        (lambda: VideoGroups(length=0), "expected 1 to 1000"),
        (lambda: Worsening(compression=9, video=VideoGroups()), "JPEG files or groups"),
    ],
)
def test_what_cannot_be(make: object, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        make()  # type: ignore[operator]
