"""`Frame`: one picture of a traverse, known by name and place, decoded only when asked."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from retraverse.errors import FrameReadError, ShapeError
from retraverse.images.decode import ColourOrder, GreyPath, check_array, check_colour_order
from retraverse.images.pixels import ArrayPixels, FilePixels, Pixels
from retraverse.types import Array, ImageArray

__all__ = ["Frame"]


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture: what is known about it at once, and its pixels on request.

    A frame holds no pixels; each call decodes anew. All methods are thread-safe and give
    arrays of the caller's own. Every method that touches the pixels raises
    `FrameReadError` (or, for an array that is no picture, `ShapeError`) with the name of
    the picture and the reason.
    """

    name: str
    """File name, or for arrays and videos a name made of the frame number."""
    index: int
    """Frame number in the source, from 0, counted before any frame was thinned out or skipped."""
    path: Path | None = None
    """The picture file; None for arrays and frames of a video."""
    timestamp_s: float | None = None
    """Seconds from the start of the video; None where unknown."""
    pixels: Pixels = field(kw_only=True, repr=False, compare=False)
    """Where the pixels come from."""

    @classmethod
    def from_file(cls, path: str | Path, *, name: str | None = None, index: int = 0) -> "Frame":
        """Return the frame of a picture file, which is not opened yet.

        Parameters
        ----------
        path : str or Path
        name : str, optional
            By default the file name.
        index : int
            Frame number in the source, from 0.
        """
        path = Path(path)
        return cls(_printable(name or path.name), index, path, pixels=FilePixels(path))

    @classmethod
    def from_array(
        cls,
        array: Array,
        *,
        name: str | None = None,
        index: int = 0,
        timestamp_s: float | None = None,
        colour_order: ColourOrder = "rgb",
    ) -> "Frame":
        """Return the frame of pixels already in memory, which it shares.

        Parameters
        ----------
        array : uint8 or uint16 array, shape (H, W), (H, W, 3) or (H, W, 4)
            uint16 keeps its upper 8 bits; a fourth channel is dropped.
        name : str, optional
            By default the frame number in six digits.
        index : int
            Frame number in the source, from 0.
        timestamp_s : float, optional
        colour_order : {"rgb", "bgr"}

        Raises
        ------
        ShapeError
            If the array is no picture.
        """
        check_colour_order(colour_order)
        pixels = ArrayPixels((check_array(array),), 0, colour_order)
        return cls(name or f"{index:06d}", index, timestamp_s=timestamp_s, pixels=pixels)

    def encoded(self) -> bytes | None:
        """Return the bytes of the picture file as they are, None for arrays and videos."""
        with self._naming():
            return self.pixels.encoded()

    def grey(self, path: GreyPath = "decoder") -> ImageArray:
        """Return the grey picture.

        Parameters
        ----------
        path : {"decoder", "from_colour"}
            ``decoder`` equals ``cv2.imread(file, 0)``, ``from_colour`` decodes colour and
            converts; for arrays and videos, which have no decoder's grey, both convert.

        Returns
        -------
        grey : uint8 array, shape (height, width)
        """
        with self._naming():
            return self.pixels.grey(path)

    def colour(self) -> ImageArray:
        """Return the colour picture, uint8 (height, width, 3), RGB; grey is repeated."""
        with self._naming():
            return self.pixels.rgb()

    def fingerprint(self) -> bytes:
        """Return bytes that differ where the pixels do: what content hashes are made of."""
        with self._naming():
            return self.pixels.fingerprint()

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) in pixels, after EXIF rotation. Decodes the picture."""
        height, width = self.grey().shape
        return height, width

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Put the name of the picture before the reason it cannot be read for."""
        try:
            yield
        except (FrameReadError, ShapeError) as error:
            raise type(error)(f"cannot read {self.path or self.name}: {error}") from error


def _printable(name: str) -> str:
    """Escape what is not Unicode in a file name, so that it can be written anywhere."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")
