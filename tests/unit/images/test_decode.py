"""Decoding means what cv2.imread means, and what Pillow sees in the same files."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from retraverse.errors import ConfigError, FrameReadError, ShapeError
from retraverse.images import Frame, decode_bgr, decode_grey
from retraverse.images.decode import check_array, quiet_opencv
from retraverse.types import Array, ImageArray

Encoder = Callable[..., bytes]

LOSSLESS: list[tuple[str, str, dict[str, Any]]] = [
    ("PNG", "png", {}),
    ("BMP", "bmp", {}),
    ("PPM", "ppm", {}),
    ("WEBP", "webp", {"lossless": True}),
    ("TIFF", "tif", {}),
    ("TIFF", "tiff", {"compression": "tiff_lzw"}),
    ("TIFF", "tiff", {"compression": "tiff_deflate"}),
]
LOSSY: list[tuple[str, str, dict[str, Any]]] = [
    ("JPEG", "jpg", {"quality": 95}),
    ("JPEG", "jpeg", {"quality": 95, "progressive": True}),
    ("JPEG", "jpg", {"quality": 95, "subsampling": 0}),
    ("WEBP", "webp", {"quality": 95}),
]


@pytest.mark.parametrize(("kind", "suffix", "options"), LOSSLESS + LOSSY)
def test_both_grey_paths_and_colour_equal_imread(
    kind: str,
    suffix: str,
    options: dict[str, Any],
    scene: ImageArray,
    encoder: Encoder,
    tmp_path: Path,
) -> None:
    path = tmp_path / f"picture.{suffix}"
    path.write_bytes(encoder(scene, kind, **options))
    assert_equals_imread(path)
    difference = np.abs(Frame.from_file(path).colour().astype(int) - scene)
    assert difference.mean() <= (0 if (kind, suffix, options) in LOSSLESS else 3)


def assert_equals_imread(path: Path) -> None:
    frame = Frame.from_file(path)
    colour = cv2.imread(str(path))
    assert colour is not None
    np.testing.assert_array_equal(frame.grey("decoder"), cv2.imread(str(path), 0))
    np.testing.assert_array_equal(
        frame.grey("from_colour"), cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    )
    np.testing.assert_array_equal(frame.colour(), cv2.cvtColor(colour, cv2.COLOR_BGR2RGB))


def test_grey_paths_on_real_pictures(shared: Callable[[str], Path]) -> None:
    for path in sorted(shared("data/corridor/query").glob("*.jpg"))[::10]:
        assert_equals_imread(path)
    for path in sorted(shared("data/stromovka/autumn").glob("*.jpg"))[::25]:
        assert_equals_imread(path)
        frame = Frame.from_file(path)
        difference = frame.grey("decoder").astype(int) - frame.grey("from_colour")
        assert 1 <= np.abs(difference).max() <= 12


def test_grey_pictures(scene: ImageArray, encoder: Encoder) -> None:
    grey = scene[:, :, 0].copy()
    for kind in ("PNG", "BMP", "PPM", "TIFF"):
        encoded = encoder(grey, kind)
        for path in ("decoder", "from_colour"):
            np.testing.assert_array_equal(decode_grey(encoded, path), grey)
        np.testing.assert_array_equal(decode_bgr(encoded), np.dstack([grey] * 3))


@pytest.mark.parametrize("suffix", [".png", ".pgm", ".tiff"])
def test_16_bit_grey_keeps_the_upper_8_bits(suffix: str) -> None:
    values = np.arange(0, 65536, 7, dtype=np.uint16).reshape(-1, 3)
    encoded = cv2.imencode(suffix, values)[1].tobytes()
    np.testing.assert_array_equal(decode_grey(encoded), values // 256)
    np.testing.assert_array_equal(decode_bgr(encoded)[:, :, 0], values // 256)


@pytest.mark.parametrize("suffix", [".png", ".ppm", ".tiff"])
def test_16_bit_colour_is_brought_to_8_bits(suffix: str) -> None:
    values = np.arange(0, 65536, 5, dtype=np.uint16)[: 13107 // 9 * 9].reshape(-1, 3, 3)
    encoded = cv2.imencode(suffix, values)[1].tobytes()
    # Colour TIFF is scaled by 255/65535 and rounded, which differs by one level at most.
    tolerance = 1 if suffix == ".tiff" else 0
    np.testing.assert_allclose(decode_bgr(encoded).astype(int), values // 256, atol=tolerance)


@pytest.mark.parametrize(("kind", "options"), [("PNG", {}), ("WEBP", {"lossless": True})])
def test_alpha_is_dropped_without_blending(
    kind: str, options: dict[str, Any], scene: ImageArray, encoder: Encoder
) -> None:
    alpha = np.full(scene.shape[:2], 0, np.uint8)
    alpha[::2] = 200
    encoded = encoder(np.dstack([scene, alpha]), kind, **options, **EXACT.get(kind, {}))
    np.testing.assert_array_equal(decode_bgr(encoded)[..., ::-1], scene)


# Without it, WebP throws away the colours under transparent pixels.
EXACT: dict[str, dict[str, Any]] = {"WEBP": {"exact": True}}


def test_palette_and_one_bit_pictures(scene: ImageArray, encoder: Encoder) -> None:
    palette = Image.fromarray(scene).quantize(16)
    np.testing.assert_array_equal(
        decode_bgr(encoder(palette, "PNG"))[..., ::-1], np.asarray(palette.convert("RGB"))
    )
    bits = Image.fromarray(scene).convert("1")
    for kind in ("PNG", "PPM"):
        np.testing.assert_array_equal(
            decode_grey(encoder(bits, kind)), np.asarray(bits.convert("L"))
        )


def test_cmyk_jpeg(scene: ImageArray, encoder: Encoder) -> None:
    encoded = encoder(Image.fromarray(scene).convert("CMYK"), "JPEG", quality=95)
    assert np.abs(decode_bgr(encoded)[..., ::-1].astype(int) - scene).mean() < 5


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
def test_exif_rotation_is_applied_on_every_path(
    kind: str, orientation: int, scene: ImageArray, encoder: Encoder
) -> None:
    image = Image.fromarray(scene)
    exif = image.getexif()
    exif[0x0112] = orientation
    encoded = encoder(image, kind, exif=exif, **({"quality": 95} if kind == "JPEG" else {}))
    image.info["exif"] = exif.tobytes()
    upright = ImageOps.exif_transpose(image)
    colour = decode_bgr(encoded)[..., ::-1].astype(int)
    assert colour.shape == np.asarray(upright).shape
    assert np.abs(colour - np.asarray(upright)).mean() < 3
    expected_grey = np.asarray(upright.convert("L")).astype(int)
    assert np.abs(decode_grey(encoded, "decoder") - expected_grey).mean() < 3
    assert np.abs(decode_grey(encoded, "from_colour") - expected_grey).mean() < 3


def test_an_unknown_grey_path_is_refused(scene: ImageArray, encoder: Encoder) -> None:
    with pytest.raises(ConfigError, match="'luma', expected one of decoder, from_colour"):
        decode_grey(encoder(scene, "PNG"), "luma")  # type: ignore[arg-type]


def test_too_many_pixels_are_refused_by_name() -> None:
    header = b"BM" + bytes(8) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little")
    side = (100_000).to_bytes(4, "little")
    huge = (
        header + side + side + (1).to_bytes(2, "little") + (24).to_bytes(2, "little") + bytes(124)
    )
    with pytest.raises(FrameReadError, match="more pixels than OpenCV reads"):
        decode_bgr(huge)


def test_opencv_is_quiet_inside_and_loud_again_outside(
    capfd: pytest.CaptureFixture[str],
) -> None:
    damaged = cv2.imencode(".bmp", np.zeros((9, 9, 3), np.uint8))[1].tobytes()[:-9]
    cv2.imdecode(np.frombuffer(damaged, np.uint8), cv2.IMREAD_COLOR)
    assert "imdecode" in capfd.readouterr().err
    with pytest.raises(FrameReadError):
        decode_bgr(damaged)
    assert capfd.readouterr().err == ""
    cv2.imdecode(np.frombuffer(damaged, np.uint8), cv2.IMREAD_COLOR)
    assert "imdecode" in capfd.readouterr().err


def test_the_users_log_level_survives_threads_that_overlap() -> None:
    log = getattr(cv2.utils, "logging", cv2)
    before = log.getLogLevel()
    first_is_in, second_is_in = threading.Event(), threading.Event()

    def first() -> None:
        with quiet_opencv():
            first_is_in.set()
            second_is_in.wait(60)

    def second() -> None:
        first_is_in.wait(60)
        with quiet_opencv():
            second_is_in.set()
            threads[0].join(60)
            levels.append(log.getLogLevel())

    levels: list[int] = []
    threads = [threading.Thread(target=first), threading.Thread(target=second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(300)
    assert levels == [0]
    assert log.getLogLevel() == before


def test_arrays_become_8_bit_pictures(scene: ImageArray) -> None:
    grey = scene[:, :, 0]
    opaque = np.full(grey.shape, 255, np.uint8)
    np.testing.assert_array_equal(check_array(grey), grey)
    np.testing.assert_array_equal(check_array(grey[..., None]), grey)
    np.testing.assert_array_equal(check_array(scene), scene)
    np.testing.assert_array_equal(check_array(np.dstack([scene, opaque])), scene)
    np.testing.assert_array_equal(check_array(scene.astype(np.uint16) * 257), scene)
    np.testing.assert_array_equal(check_array((scene.astype(">u2")) * 256), scene)
    np.testing.assert_array_equal(check_array(Image.fromarray(scene)), scene)
    np.testing.assert_array_equal(check_array(scene[:, ::-1]), scene[:, ::-1])


@pytest.mark.parametrize(
    ("item", "part"),
    [
        (np.zeros((4, 5), np.float32), "float32, expected uint8.*multiply 0..1 by 255"),
        (np.zeros((4, 5), np.int64), "int64, expected uint8"),
        (np.zeros((4, 5), bool), "bool, expected uint8"),
        (None, "NoneType, expected uint8"),
        ("a.jpg", "text .*pass list"),
        (np.zeros((3, 40, 50), np.uint8), r"\(3, 40, 50\).*channels first"),
        (np.zeros((4, 5, 2), np.uint8), r"shape \(4, 5, 2\), expected \(height, width\)"),
        (np.zeros(4, np.uint8), r"shape \(4,\)"),
        (np.zeros((2, 4, 5, 3), np.uint8), r"shape \(2, 4, 5, 3\)"),
        (np.zeros((0, 5), np.uint8), "no pixels"),
        (np.zeros((5, 0, 3), np.uint8), "no pixels"),
        ([[1, 2], [3]], "list, expected an array"),
    ],
)
def test_what_is_no_picture_is_refused(item: Array | object, part: str) -> None:
    with pytest.raises(ShapeError, match=part):
        check_array(item)
