"""What holds for any picture that is resized, compressed, stripped and restored."""

import io
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from retraverse.errors import InputError
from retraverse.images import Encoder, Frame, Worsening, encode_jpeg, worsen_frame
from retraverse.images.bare_jpeg import TableSet, restore_tables, strip_tables
from retraverse.images.quantisation import QuantisationTables
from retraverse.types import ImageArray

TABLES = TableSet.for_encoder() | TableSet.for_encoder(Encoder(optimize=True), range(0, 100, 7))


@st.composite
def pictures(draw: st.DrawFn) -> ImageArray:
    height, width = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    shape = draw(st.sampled_from([(height, width), (height, width, 3)]))
    smooth = draw(st.booleans())
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    noise = random.integers(0, 256, shape, dtype=np.uint8)
    return np.full(shape, noise.flat[0], np.uint8) if smooth else noise


encoders = st.builds(
    Encoder,
    optimize=st.booleans(),
    progressive=st.booleans(),
    subsampling=st.sampled_from(["4:2:0", "4:2:2", "4:4:4"]),
    library=st.sampled_from(["pillow", "opencv"]),
)


@settings(max_examples=40)
@given(pictures(), st.integers(0, 99), encoders)
def test_both_libraries_write_one_file_and_it_keeps_size_and_kind(
    picture: ImageArray, c: int, encoder: Encoder
) -> None:
    jpeg = encode_jpeg(picture, c, encoder)
    other = Encoder(
        encoder.optimize,
        encoder.progressive,
        encoder.subsampling,
        library="opencv" if encoder.library == "pillow" else "pillow",
    )
    assert encode_jpeg(picture, c, other) == jpeg
    decoded = np.asarray(Image.open(io.BytesIO(jpeg)))
    assert decoded.shape == picture.shape


@settings(max_examples=40)
@given(pictures(), st.integers(0, 99), encoders)
def test_stripping_and_restoring_is_the_identity(
    picture: ImageArray, c: int, encoder: Encoder
) -> None:
    jpeg = encode_jpeg(picture, c, encoder)
    for tables in (TABLES, TableSet(frozenset()), TableSet.learned_from([jpeg])):
        bare = strip_tables(jpeg, tables)
        assert restore_tables(bare, tables) == jpeg
        assert len(bare) <= len(jpeg)


@given(st.binary(max_size=300))
def test_any_bytes_pass_and_any_bare_bytes_are_refused_or_restored(content: bytes) -> None:
    assert restore_tables(strip_tables(content, TABLES), TABLES) == content
    with suppress(InputError):
        restore_tables(content, TABLES)


@settings(max_examples=30)
@given(
    pictures(),
    st.one_of(st.none(), st.integers(1, 32)),
    st.sampled_from(["pillow", "opencv"]),
    st.one_of(st.none(), st.integers(0, 99)),
)
def test_a_worse_picture_has_the_size_asked_for_and_the_kind_it_had(
    picture: ImageArray, resize: int | None, resizer: str, c: int | None
) -> None:
    frame = Frame.from_array(picture)
    made = worsen_frame(frame, Worsening(resize, resizer, c))  # type: ignore[arg-type]
    expected = picture.shape[:2] if resize is None else (resize, resize)
    assert made.frame.size == expected
    channels = 1 if picture.ndim == 2 else 3
    if c is None:
        assert made.n_bytes == expected[0] * expected[1] * channels
    else:
        mode = Image.open(io.BytesIO(made.frame.encoded() or b"")).mode
        assert mode == ("L" if picture.ndim == 2 else "RGB")


@settings(max_examples=20)
@given(st.lists(st.integers(1, 255), min_size=64, max_size=64), st.integers(1, 100))
def test_scaled_steps_stay_in_order_and_in_range(steps: list[int], quality: int) -> None:
    tables = QuantisationTables(tuple(steps), tuple(steps))
    scaled, _ = tables.at_quality(quality)
    assert all(1 <= step <= 255 for step in scaled)
    order = np.argsort(steps, kind="stable")
    assert (np.diff(np.array(scaled)[order]) >= 0).all()


def test_the_published_small_files_need_optimized_huffman_tables() -> None:
    # The thesis' images of 256 px at c = 99 weigh 1.07 KB (table 6.1: 3.38 % of 31.6 KB). With the
    # standard's Huffman tables a picture of one colour takes 256 x (4 x 6 + 2 x 4) bits of pixels
    # and 623 bytes of header, so that a plain encoder cannot have made them.
    flat = np.full((256, 256, 3), 128, np.uint8)
    plain, small = (len(encode_jpeg(flat, 99, Encoder(optimize=on))) for on in (False, True))
    assert plain == pytest.approx(623 + 256 * 32 / 8, abs=4)
    assert small < 1070 < plain
