"""From the bytes of a picture file, or an array a user made, to grey and colour pixels.

Conventions
- Files are decoded by OpenCV and mean what ``cv2.imread`` says they mean: EXIF rotation is
  applied (in WebP only by recent versions of OpenCV), an alpha channel is dropped without
  blending (TIFF blends with black), 16-bit values keep their upper 8 bits (colour TIFF
  rounds instead), palettes are looked up, CMYK is converted.
- There are two grey paths, which differ by up to 12 levels; every technique names its own.
- Arrays are uint8 (height, width) grey or (height, width, 3); functions say RGB or BGR.
- Errors here give the reason only; `Frame` puts the name of the picture before it.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal, cast, get_args

import numpy as np

from retraverse.errors import ConfigError, FrameReadError, ShapeError
from retraverse.images.damage import explain_undecodable, find_damage
from retraverse.types import Array, ImageArray

__all__ = [
    "ColourOrder",
    "GreyPath",
    "check_array",
    "check_colour_order",
    "decode_bgr",
    "decode_grey",
    "decode_native",
    "quiet_opencv",
    "to_grey",
    "to_rgb",
]

GreyPath = Literal["decoder", "from_colour"]
"""``decoder``: the decoder's own grey (``cv2.imread(path, 0)``), for JPEG its luminance plane;
``from_colour``: decoded to colour, then converted by ``cv2.cvtColor``."""
ColourOrder = Literal["rgb", "bgr"]
"""The order of the channels in a user's arrays; OpenCV's own is ``bgr``."""


def decode_grey(encoded: bytes, path: GreyPath = "decoder") -> ImageArray:
    """Return the grey picture in the bytes of a picture file.

    Parameters
    ----------
    encoded : bytes
        A whole file: JPEG, PNG, BMP, PPM, PGM, WebP, TIFF, and what else OpenCV reads.
    path : {"decoder", "from_colour"}
        Which of the two grey paths.

    Returns
    -------
    grey : uint8 array, shape (height, width)

    Raises
    ------
    FrameReadError
        If the bytes are empty, truncated, damaged or no picture; the message is the reason.
    ConfigError
        If there is no such grey path.
    """
    if path == "decoder":
        import cv2

        return _decode(encoded, cv2.IMREAD_GRAYSCALE)
    if path == "from_colour":
        return to_grey(decode_bgr(encoded), "bgr")
    raise ConfigError(f"grey path: got {path!r}, expected one of {', '.join(get_args(GreyPath))}")


def decode_bgr(encoded: bytes) -> ImageArray:
    """Return the colour picture in the bytes of a picture file, in OpenCV's channel order.

    Returns
    -------
    colour : uint8 array, shape (height, width, 3), BGR
        Grey files give three equal channels.

    Raises
    ------
    FrameReadError
        If the bytes are empty, truncated, damaged or no picture; the message is the reason.
    """
    import cv2

    return _decode(encoded, cv2.IMREAD_COLOR)


def decode_native(encoded: bytes) -> ImageArray:
    """Return the picture in the bytes of a file as grey if the file is grey, else as BGR.

    Returns
    -------
    picture : uint8 array, shape (height, width) or (height, width, 3)
        Equal to `decode_grey` or `decode_bgr` of the same bytes. Palettes count as colour.

    Raises
    ------
    FrameReadError
        If the bytes are empty, truncated, damaged or no picture; the message is the reason.
    """
    import cv2

    return _decode(encoded, cv2.IMREAD_ANYCOLOR)


def to_grey(picture: ImageArray, order: ColourOrder) -> ImageArray:
    """Return a grey copy of a grey or colour picture, by OpenCV's conversion."""
    import cv2

    if picture.ndim == 2:
        return picture.copy()
    code = cv2.COLOR_BGR2GRAY if order == "bgr" else cv2.COLOR_RGB2GRAY
    return cast(ImageArray, cv2.cvtColor(picture, code))


def to_rgb(picture: ImageArray, order: ColourOrder) -> ImageArray:
    """Return an RGB copy of a grey or colour picture; grey gives three equal channels."""
    import cv2

    if picture.ndim == 2:
        return cast(ImageArray, cv2.cvtColor(picture, cv2.COLOR_GRAY2RGB))
    if order == "bgr":
        return cast(ImageArray, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
    return picture.copy()


def check_array(item: object) -> ImageArray:
    """Return a user's array as uint8 (height, width) or (height, width, 3), or say what is wrong.

    uint16 keeps its upper 8 bits, a fourth channel (alpha) is dropped, a single one
    squeezed; the channel order stays what it was. Anything NumPy takes for an array
    will do, a Pillow image too. The result may share memory with `item`.

    Raises
    ------
    ShapeError
        If it is no array of uint8 or uint16, not a picture by its shape, or has no pixels.
    """
    array = _as_array(item)
    if array.dtype not in (np.uint8, np.uint16):
        raise ShapeError(_wrong_type(item, array))
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[:, :, 0]
    if array.ndim != 2 and not (array.ndim == 3 and array.shape[2] in (3, 4)):
        raise ShapeError(
            f"shape {array.shape}, expected (height, width), (height, width, 3) or "
            f"(height, width, 4){_shape_hint(array.shape)}"
        )
    if array.size == 0:
        raise ShapeError(f"no pixels: shape {array.shape}")
    if array.dtype == np.uint16:
        array = (array >> 8).astype(np.uint8)
    return np.ascontiguousarray(array[..., :3] if array.ndim == 3 else array)


def check_colour_order(order: str) -> None:
    """Raise `ConfigError` unless `order` is one of `ColourOrder`."""
    if order not in get_args(ColourOrder):
        raise ConfigError(
            f"colour_order: got {order!r}, expected one of {', '.join(get_args(ColourOrder))}"
        )


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Keep OpenCV's log lines off stderr inside the block: our errors say it in one line.

    OpenCV has one log level for the whole process, so threads count themselves in and
    out and the last one restores what the user had set.
    """
    import cv2

    # OpenCV moved these two functions between 4.10 and 4.14.
    log = getattr(cv2.utils, "logging", cv2)
    with _Quiet.lock:
        if _Quiet.n_inside == 0:
            _Quiet.users_level = log.getLogLevel()
            log.setLogLevel(0)
        _Quiet.n_inside += 1
    try:
        yield
    finally:
        with _Quiet.lock:
            _Quiet.n_inside -= 1
            if _Quiet.n_inside == 0:
                log.setLogLevel(_Quiet.users_level)


class _Quiet:
    """How many threads are inside `quiet_opencv`, and the level to restore after the last."""

    lock = threading.Lock()
    n_inside = 0
    users_level = 0


def _decode(encoded: bytes, flag: int) -> ImageArray:
    import cv2

    damage = find_damage(encoded)
    if damage is not None:
        raise FrameReadError(damage)
    try:
        with quiet_opencv():
            picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), flag)
    except cv2.error as error:
        raise FrameReadError(_refusal(error)) from error
    if picture is None:
        raise FrameReadError(explain_undecodable(encoded))
    return cast(ImageArray, picture)


def _refusal(error: Exception) -> str:
    """Return OpenCV's own complaint, which spans several lines, as one clause."""
    complaint = str(getattr(error, "err", "") or error)
    if "CV_IO_MAX_IMAGE" in complaint:
        return (
            "it claims more pixels than OpenCV reads (2^20 a side, 2^30 in all): damaged, or "
            "a decompression bomb"
        )
    return f"OpenCV cannot decode it: {' '.join(complaint.split())}"


def _as_array(item: object) -> Array:
    try:
        return np.asarray(item)
    except (TypeError, ValueError) as error:
        raise ShapeError(f"{type(item).__name__}, expected an array: {error}") from error


def _wrong_type(item: object, array: Array) -> str:
    got = str(array.dtype) if array.dtype != object else type(item).__name__
    if array.dtype.kind == "U":
        got = "text (paths are told from arrays only in a list or tuple: pass list(...))"
    hint = ": multiply 0..1 by 255 and convert with astype" if array.dtype.kind == "f" else ""
    return f"{got}, expected uint8 (0..255) or uint16 pixels{hint}"


def _shape_hint(shape: tuple[int, ...]) -> str:
    if len(shape) == 3 and shape[0] in (1, 3, 4):
        return " (channels first? transpose them to the end)"
    return ""
