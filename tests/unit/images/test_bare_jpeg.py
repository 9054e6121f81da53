import random
from typing import Any

import cv2
import numpy as np
import pytest

from retraverse.errors import InputError
from retraverse.images.bare_jpeg import TableSet, restore_tables, strip_tables
from retraverse.images.jpeg import Encoder, encode_jpeg
from retraverse.images.quantisation import QuantisationTables
from retraverse.types import ImageArray

ENCODERS = {
    "plain": Encoder(),
    "optimize": Encoder(optimize=True),
    "progressive": Encoder(progressive=True),
    "4:4:4": Encoder(subsampling="4:4:4"),
    "opencv": Encoder(library="opencv"),
    "tables": Encoder(tables=QuantisationTables((9,) * 64, (30,) * 64)),
}


def picture(seed: int = 0, height: int = 40, width: int = 57) -> ImageArray:
    noise = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.5), np.uint8)


@pytest.mark.parametrize("name", ENCODERS)
@pytest.mark.parametrize("grey", [True, False])
def test_files_come_back_byte_for_byte_and_were_smaller(name: str, grey: bool) -> None:
    encoder = ENCODERS[name]
    compressions = (0, 50, 80, 90, 95, 97, 99)
    tables = TableSet.for_encoder(encoder, compressions)
    for seed, c in enumerate(compressions):
        colour = picture(seed, 16 + 8 * seed, 100 - seed)
        jpeg = encode_jpeg(colour[..., 0] if grey else colour, c, encoder)
        bare = strip_tables(jpeg, tables)
        assert restore_tables(bare, tables) == jpeg
        # By T.81: two 67-byte quantisation tables (one if grey), 420 bytes of standard Huffman
        # tables (210), frame, scan, JFIF and marks; 9 bytes are ours.
        own_huffman = name in ("optimize", "progressive")
        least = {(True, True): 90, (True, False): 300, (False, True): 150, (False, False): 600}
        assert len(jpeg) - len(bare) >= least[grey, own_huffman]


def test_the_tables_of_all_compressions_serve_every_file() -> None:
    tables = TableSet.for_encoder()
    for c in range(100):
        jpeg = encode_jpeg(picture(c), c)
        assert len(strip_tables(jpeg, tables)) == len(jpeg) - 616, c


def test_a_set_learned_from_one_file_serves_the_others_of_its_kind() -> None:
    tables = TableSet.learned_from([encode_jpeg(picture(0), 95), b"no picture", b""])
    other = encode_jpeg(picture(1, 24, 24), 95)
    assert len(strip_tables(other, tables)) < len(other) - 600
    # A file whose Huffman tables are its own shares the rest of the header.
    optimized = encode_jpeg(picture(1), 95, Encoder(optimize=True))
    bare = strip_tables(optimized, tables)
    assert len(bare) < len(optimized) - 150
    assert restore_tables(bare, tables) == optimized


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xd8",
        b"\xff\xd8\xff",
        b"\xb0",
        b"\xb1 something that begins like a bare picture",
        b"\xb2",
        b"\x89PNG\r\n\x1a\n",
        encode_jpeg(picture(), 94),
        encode_jpeg(picture(), 95)[:-2],
        encode_jpeg(picture(), 95)[:300],
        encode_jpeg(picture(), 95) + b"tail",
        b"\xff\xd8\xff\xfe\x00\x04hi" + encode_jpeg(picture(), 95)[2:],
        encode_jpeg(picture(), 95).replace(b"\xff\xc0", b"\xff\xc3"),
    ],
)
def test_what_is_unknown_passes_unharmed(content: bytes) -> None:
    tables = TableSet.for_encoder(compressions=[95])
    passed = strip_tables(content, tables)
    assert len(passed) <= len(content) + 1
    assert restore_tables(passed, tables) == content


def test_sets_travel_and_join() -> None:
    one = TableSet.for_encoder(compressions=[90])
    both = one | TableSet.for_encoder(compressions=[95])
    assert TableSet.from_bytes(both.to_bytes()) == both
    assert both.to_bytes() == (TableSet.for_encoder(compressions=[95]) | one).to_bytes()
    jpeg = encode_jpeg(picture(), 95)
    with pytest.raises(InputError, match=r"its tables \([0-9a-f]{8}\) are not among"):
        restore_tables(strip_tables(jpeg, both), one)


@pytest.mark.parametrize("content", [b"", b"x" * 100, b"retraverse JPEG tables 1\nshort"])
def test_bytes_that_are_no_set(content: bytes) -> None:
    with pytest.raises(InputError, match="JPEG tables: "):
        TableSet.from_bytes(content)


def test_a_damaged_set_is_noticed() -> None:
    content = bytearray(TableSet.for_encoder(compressions=[90]).to_bytes())
    content[-1] ^= 1
    with pytest.raises(InputError, match="the checksum does not fit"):
        TableSet.from_bytes(bytes(content))
    with pytest.raises(InputError, match="the checksum does not fit"):
        TableSet.from_bytes(bytes(content[:-9]))


@pytest.mark.parametrize("optimize", [False, True])
def test_truncated_pictures_are_refused_or_come_back_short(optimize: bool) -> None:
    encoder = Encoder(optimize=optimize)
    tables = TableSet.for_encoder(encoder, [97])
    jpeg = encode_jpeg(picture(), 97, encoder)
    bare = strip_tables(jpeg, tables)
    refused = 0
    for length in range(1, len(bare)):
        try:
            restored = restore_tables(bare[:length], tables)
        except InputError:
            refused += 1
        else:
            assert restored[:-2] == jpeg[: len(restored) - 2]
    assert refused >= 8


def test_fuzz_gives_bytes_or_an_input_error(scaled: Any) -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    tables = TableSet.for_encoder(compressions=[50, 97])
    tables |= TableSet.for_encoder(Encoder(optimize=True), [97])
    starts = [
        strip_tables(encode_jpeg(picture(), c, Encoder(optimize=on)), tables)
        for c in (50, 97)
        for on in (False, True)
    ]
    starts += [encode_jpeg(picture(), 97)]
    for _ in range(scaled(20_000)):
        content = bytearray(draw.choice(starts))
        for _ in range(draw.randrange(1, 6)):
            content[draw.randrange(min(len(content), draw.choice((12, 700))))] = draw.randrange(256)
        damaged = bytes(content[: draw.randrange(1, len(content) + 1)])
        # Whatever it is, it survives the way there and back.
        assert restore_tables(strip_tables(damaged, tables), tables) == damaged
        try:
            restore_tables(damaged, tables)
        except InputError:
            continue
