"""Pictures made on the spot: smooth enough for JPEG, coloured enough to tell channels apart."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from retraverse.types import ImageArray


def make_scene(height: int = 48, width: int = 64) -> ImageArray:
    """Return RGB ramps that differ in every channel and corner."""
    y, x = np.mgrid[0:height, 0:width]
    red, green, blue = (
        255 * x // width,
        255 * y // height,
        255 * (height - y + x) // (height + width),
    )
    return np.dstack([red, green, blue]).astype(np.uint8)


def encode(picture: ImageArray | Image.Image, kind: str, **options: Any) -> bytes:
    """Return a picture file written by Pillow."""
    image = picture if isinstance(picture, Image.Image) else Image.fromarray(picture)
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


@pytest.fixture
def scene() -> ImageArray:
    return make_scene()


@pytest.fixture
def encoder() -> Callable[..., bytes]:
    return encode


@pytest.fixture
def make_folder(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that fills a folder with named, distinct PNG pictures."""

    def fill(*names: str, folder: str = "drive") -> Path:
        path = tmp_path / folder
        path.mkdir(exist_ok=True)
        for number, name in enumerate(names):
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            grey = np.full((8, 12), number, np.uint8)
            (path / name).write_bytes(encode(grey, "PNG"))
        return path

    return fill
