"""Thumbnails: small, made once, and never a reason to lose the page."""

import base64
import io

import numpy as np
import pytest
from PIL import Image
from tests.unit.reports.records import pictures

from retraverse.errors import FrameReadError
from retraverse.images import Frame
from retraverse.reports.pictures import PictureBook, thumbnail
from retraverse.types import ImageArray


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ((48, 64, 3), (64, 48)),
        ((1, 1, 3), (1, 1)),
        ((480, 640, 3), (242, 182)),
        ((2, 60_000, 3), (36332, 1)),
    ],
)
def test_thumbnails_are_bounded_in_area_and_keep_their_shape(
    shape: tuple[int, ...], size: tuple[int, int]
) -> None:
    jpeg, got = thumbnail(np.full(shape, 90, np.uint8))
    assert got == size
    with Image.open(io.BytesIO(jpeg)) as image:
        assert (image.format, image.size) == ("JPEG", size)


def test_a_thumbnail_shows_the_picture() -> None:
    pixels = np.zeros((100, 100, 3), np.uint8)
    pixels[:, 50:] = (250, 10, 10)
    jpeg, _ = thumbnail(pixels)
    with Image.open(io.BytesIO(jpeg)) as image:
        decoded = np.asarray(image, np.int64)
    assert np.abs(decoded[:, :40]).max() < 12
    assert np.abs(decoded[:, 60:] - (250, 10, 10)).max() < 12


class Counted(list[Frame]):
    reads = 0

    def __getitem__(self, index: int) -> Frame:  # type: ignore[override]
        self.reads += 1
        return super().__getitem__(index)


def test_each_picture_is_read_once_and_both_sides_are_kept_apart() -> None:
    query, reference = Counted(pictures(9)), Counted(pictures(9))
    book = PictureBook(query, reference)
    first = book.get("query", 3)
    assert book.get("query", 3) is first
    assert (first.key, book.get("reference", 8).key) == ("q3", "r8")
    assert (query.reads, reference.reads) == (1, 1)
    head, _, body = first.uri.partition(",")
    assert head == "data:image/jpeg;base64"
    assert base64.b64decode(body)[:2] == b"\xff\xd8"
    assert book.n_bytes == sum(len(picture.uri) for picture in book.pictures.values())


class Torn:
    def colour(self) -> ImageArray:
        raise FrameReadError("torn.jpg: ends early")


def test_a_picture_that_cannot_be_read_becomes_a_grey_field() -> None:
    book = PictureBook([Torn()], [Torn()])
    assert not book.get("query", 0).readable
