"""JPEG as the thesis uses it: compression c in 0..99 is quality 100 - c, options on record.

The bytes of a file depend on the encoder's options (with `optimize` a file of quality 3 is a third
smaller, pixel for pixel the same), so every size that is reported names its `Encoder.label`.
Pillow and OpenCV write identical bytes at every quality; Pillow alone takes tables of one's own.
"""

import io
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from retraverse.errors import ConfigError, InputError
from retraverse.images.decode import check_array
from retraverse.images.quantisation import QuantisationTables
from retraverse.types import ImageArray

__all__ = [
    "MAX_COMPRESSION",
    "Encoder",
    "JpegLibrary",
    "Subsampling",
    "check_compression",
    "encode_jpeg",
    "encoder_versions",
]

MAX_COMPRESSION = 99
"""The strongest c: JPEG quality 1."""

Subsampling = Literal["4:2:0", "4:2:2", "4:4:4"]
"""The colour planes' share of the pixels: a quarter, half, all. No matter for grey pictures."""
JpegLibrary = Literal["pillow", "opencv"]

# As OpenCV writes them: sampling factors of the three planes, one hexadecimal digit each.
_OPENCV_SUBSAMPLING = {"4:2:0": 0x221111, "4:2:2": 0x211111, "4:4:4": 0x111111}


@dataclass(frozen=True)
class Encoder:
    """How JPEG files are written; part of the record of every run."""

    optimize: bool = False
    """Whether Huffman tables are made for each picture: smaller files, the same pixels."""
    progressive: bool = False
    """Whether the file is progressive: the same pixels in another order."""
    subsampling: Subsampling = "4:2:0"
    """How coarse the colour planes are."""
    tables: QuantisationTables | None = None
    """Quantisation at quality 50; None = the standard's."""
    library: JpegLibrary = "pillow"
    """Who writes; OpenCV is twice as fast on small pictures and takes no tables."""

    def __post_init__(self) -> None:
        """Check every choice."""
        if self.subsampling not in get_args(Subsampling):
            raise ConfigError(
                f"subsampling: got {self.subsampling!r}, "
                f"expected one of {', '.join(get_args(Subsampling))}"
            )
        if self.library not in get_args(JpegLibrary):
            raise ConfigError(
                f"JPEG library: got {self.library!r}, "
                f"expected one of {', '.join(get_args(JpegLibrary))}"
            )
        if self.tables is not None and self.library == "opencv":
            raise ConfigError("JPEG library opencv writes no tables of one's own; take pillow")

    @property
    def label(self) -> str:
        """The options in words, for records: ``"pillow 4:2:0 optimize"``."""
        words: list[str] = [self.library, self.subsampling]
        words += [word for word in ("optimize", "progressive") if getattr(self, word)]
        if self.tables is not None:
            words.append(f"tables={self.tables.label}")
        return " ".join(words)


def encode_jpeg(picture: ImageArray, compression: int, encoder: Encoder | None = None) -> bytes:
    """Return a picture as a JPEG file.

    Parameters
    ----------
    picture : uint8 array, shape (height, width) or (height, width, 3) RGB
        A grey picture becomes a grey file.
    compression : int in [0, 99]
        c of the thesis: the JPEG quality is 100 - c. c = 0 is quality 100, which is not the
        picture as it was.
    encoder : Encoder, optional
        By default Pillow with its own defaults.

    Raises
    ------
    ConfigError
        If c is outside its range.
    ShapeError
        If the array is no picture.
    InputError
        If the picture is larger than JPEG can hold (65,500 pixels a side).
    """
    check_compression(compression)
    picture = check_array(picture)
    chosen = encoder or Encoder()
    write = _write_opencv if chosen.library == "opencv" else _write_pillow
    try:
        return write(picture, 100 - compression, chosen)
    except (OSError, ValueError, _opencv_error()) as error:
        height, width = picture.shape[:2]
        raise InputError(
            f"cannot write {width} x {height} pixels as JPEG: {' '.join(str(error).split())}"
        ) from error


def check_compression(compression: int) -> None:
    """Raise `ConfigError` unless c is a whole number from 0 to 99."""
    whole = isinstance(compression, (int, np.integer)) and not isinstance(compression, bool)
    if not whole or not 0 <= compression <= MAX_COMPRESSION:
        raise ConfigError(
            f"compression: got {compression!r}, expected a whole number from 0 to 99 "
            "(JPEG quality 100 - c; None for the picture as it is)"
        )


def encoder_versions(library: JpegLibrary) -> str:
    """Return the versions of what writes the bytes, for provenance and content hashes."""
    if library == "opencv":
        import cv2

        return f"opencv {cv2.__version__}"
    from PIL import __version__, features

    libjpeg = features.version("libjpeg_turbo") or features.version("jpg")
    return f"pillow {__version__} libjpeg {libjpeg}"


def _write_pillow(picture: ImageArray, quality: int, encoder: Encoder) -> bytes:
    from PIL import Image

    options: dict[str, Any] = {"quality": quality}
    if encoder.tables is not None:
        # With tables Pillow takes the quality for a percentage, so it is left out.
        tables = encoder.tables.at_quality(quality)
        options = {"qtables": tables[:1] if picture.ndim == 2 else tables}
    if picture.ndim == 3:
        options["subsampling"] = encoder.subsampling
    buffer = io.BytesIO()
    Image.fromarray(picture).save(
        buffer, "JPEG", optimize=encoder.optimize, progressive=encoder.progressive, **options
    )
    return buffer.getvalue()


def _write_opencv(picture: ImageArray, quality: int, encoder: Encoder) -> bytes:
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    options += [cv2.IMWRITE_JPEG_OPTIMIZE, int(encoder.optimize)]
    options += [cv2.IMWRITE_JPEG_PROGRESSIVE, int(encoder.progressive)]
    if picture.ndim == 3:
        options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _OPENCV_SUBSAMPLING[encoder.subsampling]]
        picture = np.ascontiguousarray(picture[..., ::-1])
    written, encoded = cv2.imencode(".jpg", picture, options)
    if not written:
        raise ValueError("OpenCV gives no reason")
    return bytes(encoded)


def _opencv_error() -> type[Exception]:
    import cv2

    error: type[Exception] = cv2.error
    return error
