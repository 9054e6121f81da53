"""How fast a descriptor becomes the bytes that are sent: against JPEG of the picture itself.

One frame at a time on one thread: 9,408 numbers (EfficientNet's), a colour picture of 256 x 256 at
quality 5 with optimised Huffman tables. Candidates take turns.

    pytest benchmarks/test_codings.py
"""

from typing import Any

import cv2
import numpy as np
import pytest
from _ratios import interleaved_minimum

from retraverse.images.jpeg import Encoder, encode_jpeg
from retraverse.techniques.sending import CODINGS, coding

DIMENSION = 9408
N_FRAMES = 150


@pytest.fixture(scope="module")
def picture() -> Any:
    rng = np.random.default_rng(1)
    layers = [cv2.resize(rng.uniform(0, 255, (n, n, 3)), (256, 256)) for n in (2, 8, 32, 160)]
    return np.mean(layers, axis=0).astype(np.uint8)


@pytest.mark.parametrize("name", CODINGS)
def test_against_jpeg(benchmark: Any, picture: Any, name: str) -> None:
    rng = np.random.default_rng(2)
    coder = coding(name).coder(rng.normal(size=(N_FRAMES, DIMENSION)).astype(np.float32))
    row = rng.normal(size=(1, DIMENSION)).astype(np.float32)
    message = coder.encode(row)
    encoder = Encoder(optimize=True)
    seconds = interleaved_minimum(
        {
            "encode": lambda: coder.encode(row),
            "decode": lambda: coder.decode(message),
            "jpeg": lambda: encode_jpeg(picture, 95, encoder),
        },
        rounds=50,
    )
    for end in ("encode", "decode"):
        benchmark.extra_info[f"{end} / jpeg"] = round(seconds[end] / seconds["jpeg"], 2)
        benchmark.extra_info[f"{end} ms"] = round(1e3 * seconds[end], 3)
    benchmark(coder.encode, row)
