"""Whole files pass; every truncation of a JPEG or PNG is seen, at every single length."""

import struct
import zlib
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from retraverse.images.damage import explain_undecodable, find_damage
from retraverse.images.decode import decode_bgr
from retraverse.types import ImageArray

PNG_HEAD = 8


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("JPEG", {}),
        ("JPEG", {"progressive": True}),
        ("JPEG", {"restart_marker_rows": 1}),
        ("PNG", {}),
    ],
)
def test_every_truncation_is_seen(
    kind: str, options: dict[str, object], scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    encoded = encoder(scene, kind, **options)
    assert find_damage(encoded) is None
    # Below the two bytes of a JPEG's or the eight of a PNG's head nothing tells the format.
    for length in range(PNG_HEAD, len(encoded)):
        damage = find_damage(encoded[:length])
        assert damage is not None, length
        assert "truncated" in damage


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_a_copy_that_ends_in_zeros_is_seen(
    kind: str, scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    encoded = encoder(scene, kind)
    half = encoded[: len(encoded) // 2]
    assert find_damage(half + bytes(len(encoded) - len(half))) is not None


def test_the_end_of_an_embedded_thumbnail_is_not_the_end(
    scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    thumbnail = encoder(scene[::4, ::4].copy(), "JPEG")
    encoded = encoder(scene, "JPEG", exif=b"Exif\0\0" + thumbnail)
    assert encoded.count(b"\xff\xd9") == 2
    assert find_damage(encoded) is None
    assert find_damage(encoded[:-100]) is not None


def test_bytes_after_the_end_are_allowed(scene: ImageArray, encoder: Callable[..., bytes]) -> None:
    for kind in ("JPEG", "PNG"):
        encoded = encoder(scene, kind) + b"appended by a camera maker"
        assert find_damage(encoded) is None
        assert decode_bgr(encoded).shape == scene.shape


def test_fill_bytes_and_stray_bytes_between_jpeg_segments_are_allowed(
    scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    encoded = encoder(scene, "JPEG")
    for extra in (b"\xff\xff\xff", b"\0\0", b"\xff\x01"):
        assert find_damage(encoded[:2] + extra + encoded[2:]) is None


def test_a_flipped_bit_in_png_pixels_is_seen(
    scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    encoded = bytearray(encoder(scene, "PNG"))
    encoded[len(encoded) // 2] ^= 1
    assert "checksum" in str(find_damage(bytes(encoded)))


def test_a_broken_remark_in_a_png_does_not_matter(
    scene: ImageArray, encoder: Callable[..., bytes], capfd: pytest.CaptureFixture[str]
) -> None:
    encoded = encoder(scene, "PNG")
    after_header = PNG_HEAD + 25
    remark = struct.pack(">I", 3) + b"tEXta\0b" + struct.pack(">I", 1)
    assert zlib.crc32(b"tEXta\0b") != 1
    encoded = encoded[:after_header] + remark + encoded[after_header:]
    assert find_damage(encoded) is None
    np.testing.assert_array_equal(decode_bgr(encoded)[..., ::-1], scene)


def test_other_formats_are_only_checked_for_being_empty(
    scene: ImageArray, encoder: Callable[..., bytes]
) -> None:
    assert find_damage(encoder(Image.fromarray(scene), "BMP")[:60]) is None
    assert find_damage(b"") == "the file is empty"


@pytest.mark.parametrize(
    ("encoded", "part"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0", "Git LFS pointer"),
        (b"<!DOCTYPE html><html>", "web page"),
        (b"\0\0\0\x18ftypheic", "HEIC"),
        (b"GIF89a", "GIF"),
        (b"BM\0\0", "BMP"),
        (b"P6\n3 2", "PPM"),
        (b"RIFF\0\0\0\0WEBP", "WebP"),
        (b"II*\0\0", "TIFF"),
        (b"hello", "begins with b'hello'"),
    ],
)
def test_the_likely_reason_is_told(encoded: bytes, part: str) -> None:
    assert part in explain_undecodable(encoded)
