import io
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.images.jpeg import Encoder, JpegLibrary, encode_jpeg, encoder_versions
from retraverse.images.quantisation import STANDARD_TABLES, QuantisationTables
from retraverse.types import ImageArray


def street(height: int = 60, width: int = 83, seed: int = 0) -> ImageArray:
    """Return a picture with edges and texture, of a size that is no multiple of 8."""
    random = np.random.default_rng(seed)
    picture = random.integers(0, 256, (height, width, 3), dtype=np.uint8)
    picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), 2), np.uint8)
    cv2.rectangle(picture, (10, 20), (50, 50), (200, 30, 90), -1)
    return picture


def pillow_bytes(picture: ImageArray, **options: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", **options)
    return buffer.getvalue()


def tables_in(jpeg: bytes) -> dict[int, list[int]]:
    """Return the quantisation tables Pillow reads in a file."""
    tables: dict[int, list[int]] = vars(Image.open(io.BytesIO(jpeg)))["quantization"]
    return tables


@pytest.mark.parametrize("library", ["pillow", "opencv"])
@pytest.mark.parametrize("channels", ["grey", "colour"])
def test_every_compression_is_what_pillow_saves(library: JpegLibrary, channels: str) -> None:
    picture = street()[..., 0].copy() if channels == "grey" else street()
    for c in range(100):
        expected = pillow_bytes(picture, quality=100 - c)
        assert encode_jpeg(picture, c, Encoder(library=library)) == expected, c


@pytest.mark.parametrize("library", ["pillow", "opencv"])
@pytest.mark.parametrize("subsampling", ["4:2:0", "4:2:2", "4:4:4"])
@pytest.mark.parametrize(("optimize", "progressive"), [(True, False), (False, True), (True, True)])
def test_options_are_what_pillow_saves(
    library: JpegLibrary, subsampling: Any, optimize: bool, progressive: bool
) -> None:
    encoder = Encoder(optimize, progressive, subsampling, library=library)
    expected = pillow_bytes(
        street(),
        quality=3,
        optimize=optimize,
        progressive=progressive,
        subsampling=subsampling,
    )
    assert encode_jpeg(street(), 97, encoder) == expected


def test_optimize_changes_bytes_and_no_pixel() -> None:
    plain, small = (encode_jpeg(street(), 97, Encoder(optimize=on)) for on in (False, True))
    assert len(small) < len(plain)
    one, other = (np.asarray(Image.open(io.BytesIO(file))) for file in (plain, small))
    np.testing.assert_array_equal(one, other)


def test_the_standard_tables_given_by_hand_change_nothing() -> None:
    for c in (0, 30, 50, 80, 97, 99):
        for picture in (street(), street()[..., 1].copy()):
            by_hand = encode_jpeg(picture, c, Encoder(tables=STANDARD_TABLES))
            assert by_hand == pillow_bytes(picture, quality=100 - c)


def test_tables_of_ones_own_are_in_the_file() -> None:
    tables = QuantisationTables(tuple(range(1, 65)), tuple(range(65, 129)), "ramp")
    assert tables_in(encode_jpeg(street(), 50, Encoder(tables=tables))) == {
        0: list(range(1, 65)),
        1: list(range(65, 129)),
    }
    assert tables_in(encode_jpeg(street()[..., 0], 50, Encoder(tables=tables))) == {
        0: list(range(1, 65))
    }


def test_grey_stays_grey() -> None:
    assert Image.open(io.BytesIO(encode_jpeg(street()[..., 0], 90))).mode == "L"
    assert Image.open(io.BytesIO(encode_jpeg(street(), 90))).mode == "RGB"


@pytest.mark.parametrize("compression", [-1, 100, 1.5, True, "50", None])
def test_a_compression_out_of_range(compression: Any) -> None:
    with pytest.raises(ConfigError, match=r"compression: got .*, expected a whole number from 0"):
        encode_jpeg(street(), compression)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"subsampling": "4:1:1"}, "subsampling: got '4:1:1', expected one of 4:2:0"),
        ({"library": "simplejpeg"}, "JPEG library: got 'simplejpeg', expected one of pillow"),
        ({"library": "opencv", "tables": STANDARD_TABLES}, "opencv writes no tables"),
    ],
)
def test_encoders_that_are_none(options: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        Encoder(**options)


@pytest.mark.parametrize("library", ["pillow", "opencv"])
def test_pictures_too_large_or_none(library: JpegLibrary) -> None:
    with pytest.raises(InputError, match="cannot write 70000 x 1 pixels as JPEG"):
        encode_jpeg(np.zeros((1, 70000), np.uint8), 50, Encoder(library=library))
    with pytest.raises(ShapeError):
        encode_jpeg(np.zeros((4, 4)), 50)  # type: ignore[arg-type]


def test_labels_and_versions() -> None:
    assert Encoder().label == "pillow 4:2:0"
    assert Encoder(optimize=True, progressive=True).label == "pillow 4:2:0 optimize progressive"
    assert STANDARD_TABLES.label in Encoder(tables=STANDARD_TABLES).label
    assert encoder_versions("opencv") == f"opencv {cv2.__version__}"
    assert encoder_versions("pillow").startswith("pillow ")
