"""Pictures to batches: views of a picture, seen plain and through JPEG.

Conventions
- Pictures are uint8 RGB (height, width, 3), held in memory, the longest side at most so many
  pixels: a few thousand take some hundred megabytes.
- A view is a crop at its own size in pixels *before* compression; JPEG works on blocks of 8 x 8
  pixels, so a small picture loses far more than a large one at the same quality. What a network
  takes is made of the view afterwards, by the technique's own preparation.
- Compression goes through the same codec and options as studies use (`encode_jpeg`).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.images import Frame, Traverse, open_traverse
from retraverse.images.decode import decode_bgr, to_rgb
from retraverse.images.jpeg import encode_jpeg
from retraverse.types import ImageArray, Progress, no_progress

__all__ = [
    "CompressionMix",
    "LabelledPictures",
    "View",
    "ViewSettings",
    "draw_view",
    "labelled_pictures",
    "load_pictures",
    "nearby_view",
    "seen_through_jpeg",
    "take_view",
]

LARGEST_SIDE = 320
"""Longest side in pixels of the pictures held in memory."""


@dataclass(frozen=True)
class CompressionMix:
    """How strongly pictures are compressed: c of the thesis, JPEG quality 100 - c."""

    clean: float = 0.15
    """Share of the pictures left as they are."""
    bands: tuple[tuple[float, int, int], ...] = ((0.6, 95, 99), (0.25, 88, 94), (0.15, 40, 87))
    """(share of the rest, lowest c, highest c)."""

    def __post_init__(self) -> None:
        """Check shares and ranges."""
        if not 0 <= self.clean <= 1:
            raise ConfigError(f"clean: got {self.clean}, expected 0 to 1")
        for share, low, high in self.bands:
            if share < 0 or not 0 <= low <= high <= 99:
                raise ConfigError(
                    f"compression band: got {share}, {low}, {high}, expected a share and "
                    "0 <= lowest <= highest <= 99"
                )

    def draw(self, random: np.random.Generator) -> int | None:
        """Return one c, or None for a picture left as it is."""
        if random.random() < self.clean or not self.bands:
            return None
        shares = np.array([share for share, _, _ in self.bands], np.float64)
        _, low, high = self.bands[random.choice(len(self.bands), p=shares / shares.sum())]
        return int(random.integers(low, high + 1))


@dataclass(frozen=True)
class ViewSettings:
    """How views are drawn from pictures."""

    smallest_crop: float = 0.6
    """Share of the picture's width that a view has at least."""
    shapes: tuple[float, float] = (0.8, 1.9)
    """Narrowest and widest ratio of width to height."""
    widths: tuple[int, int] = (90, 230)
    """Smallest and largest width in pixels before compression."""
    grey: float = 0.12
    """Share of the views without colour."""
    light: float = 0.5
    """Share of the views made darker or brighter."""

    def __post_init__(self) -> None:
        """Check every range."""
        if not 0 < self.smallest_crop <= 1:
            raise ConfigError(f"smallest_crop: got {self.smallest_crop}, expected 0 to 1")
        for name, (low, high), least in (("shapes", self.shapes, 0.1), ("widths", self.widths, 8)):
            if not least <= low <= high:
                raise ConfigError(f"{name}: got {low}, {high}, expected {least} <= low <= high")


@dataclass(frozen=True)
class View:
    """One way to look at a picture."""

    left: int
    top: int
    width: int
    """Of the crop in pixels of the picture."""
    height: int
    size: tuple[int, int]
    """Width and height in pixels the crop is brought to, before compression."""
    mirrored: bool
    grey: bool
    gain: float
    """The light is multiplied by this, after `gamma`."""
    gamma: float


def draw_view(random: np.random.Generator, shape: tuple[int, int], settings: ViewSettings) -> View:
    """Return a random view of a picture of (height, width) pixels."""
    tall, wide = shape
    ratio = float(np.exp(random.uniform(*np.log(settings.shapes))))
    share = random.uniform(settings.smallest_crop, 1.0)
    width = min(wide * share, tall * ratio)
    height = max(1, min(tall, round(width / ratio)))
    size_x = float(np.exp(random.uniform(*np.log(settings.widths))))
    size_y = min(size_x / ratio, settings.widths[1])
    lit = random.random() < settings.light
    gain = random.uniform(0.7, 1.3) if lit else 1.0
    gamma = float(np.exp(random.uniform(-0.4, 0.4))) if lit else 1.0
    width_px = max(1, min(wide, round(width)))
    return View(
        left=int(random.integers(0, wide - width_px + 1)),
        top=int(random.integers(0, tall - height + 1)),
        width=width_px,
        height=height,
        size=(round(size_x), max(8, round(size_y))),
        mirrored=bool(random.random() < 0.5),
        grey=bool(random.random() < settings.grey),
        gain=gain,
        gamma=gamma,
    )


def nearby_view(random: np.random.Generator, view: View, shape: tuple[int, int]) -> View:
    """Return the view from somewhat further on: nearer by up to a fifth, moved a little.

    Such pairs are the neighbours of a drive: alike, and to be told apart all the same.
    """
    tall, wide = shape
    nearer = random.uniform(0.8, 1.0)
    width, height = max(1, int(view.width * nearer)), max(1, int(view.height * nearer))
    aside = random.integers(-(view.width // 8), view.width // 8 + 1)
    up = random.integers(-(view.height // 16), view.height // 16 + 1)
    left = int(np.clip(view.left + (view.width - width) // 2 + aside, 0, wide - width))
    top = int(np.clip(view.top + (view.height - height) // 2 + up, 0, tall - height))
    return replace(view, left=left, top=top, width=width, height=height)


def take_view(picture: ImageArray, view: View, random: np.random.Generator) -> ImageArray:
    """Return a view's pixels; how it is enlarged is random, how it is shrunk is not."""
    rows, columns = (
        slice(view.top, view.top + view.height),
        slice(view.left, view.left + view.width),
    )
    crop = picture[rows, columns]
    crop = np.ascontiguousarray(crop[:, ::-1] if view.mirrored else crop)
    shrinks = view.size[0] < view.width
    enlarging = (cv2.INTER_LINEAR, cv2.INTER_CUBIC)[int(random.integers(2))]
    seen = cv2.resize(crop, view.size, interpolation=cv2.INTER_AREA if shrinks else enlarging)
    if view.gain != 1 or view.gamma != 1:
        levels = (np.arange(256) / 255) ** view.gamma * view.gain
        seen = (np.clip(levels, 0, 1) * 255).astype(np.uint8)[seen]
    if view.grey:
        seen = np.repeat(cv2.cvtColor(seen, cv2.COLOR_RGB2GRAY)[:, :, None], 3, axis=2)
    return np.asarray(seen, np.uint8)


def seen_through_jpeg(picture: ImageArray, compression: int | None) -> ImageArray:
    """Return the pixels a JPEG file of this compression gives; None leaves the picture alone."""
    if compression is None:
        return picture
    return to_rgb(decode_bgr(encode_jpeg(picture, compression)), "bgr")


@dataclass(frozen=True)
class LabelledPictures:
    """Pictures and what they show."""

    pictures: tuple[ImageArray, ...]
    labels: tuple[int, ...]
    """Number of each picture's class."""
    classes: tuple[str, ...]
    """Names of the folders, sorted."""


def load_pictures(
    source: Path | str | Traverse, *, limit: int = 0, progress: Progress = no_progress
) -> list[ImageArray]:
    """Return the pictures of a traverse, or of a folder and all folders in it.

    Parameters
    ----------
    source : Path, str or Traverse
        A folder of pictures or of folders of pictures, or anything a traverse opens from.
    limit : int
        Take so many at most, spread evenly; 0 = all.
    progress : Progress

    Raises
    ------
    DataMissingError
        If there are no pictures.
    """
    frames: Iterable[Frame]
    if isinstance(source, Traverse):
        frames = source
    else:
        folders = _folders_with_pictures(Path(source))
        frames = [frame for folder in folders for frame in open_traverse(folder)]
    chosen = list(frames)
    if not chosen:
        raise DataMissingError(f"{source}: no pictures to train on; expected picture files")
    if limit and limit < len(chosen):
        chosen = [chosen[i * len(chosen) // limit] for i in range(limit)]
    shown = progress(chosen, total=len(chosen), label="reading pictures")
    return [_fitting(frame.colour()) for frame in shown]


def labelled_pictures(
    folder: Path, *, limit: int = 0, progress: Progress = no_progress
) -> LabelledPictures:
    """Return the pictures of a folder of classes: one folder each.

    Raises
    ------
    DataMissingError
        If there is no such folder or no picture in it.
    InputError
        If there are fewer than two classes: nothing could be told apart.
    """
    if not folder.is_dir():
        raise DataMissingError(f"{folder}: no such folder; expected one folder of pictures a class")
    classes = sorted(
        path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")
    )
    if len(classes) < 2:
        raise InputError(
            f"{folder}: got {len(classes)} classes, expected at least 2, one folder of pictures "
            "each (without classes, tune by jpeg-distil)"
        )
    share = math.ceil(limit / len(classes)) if limit else 0
    pictures: list[ImageArray] = []
    labels: list[int] = []
    for label, path in enumerate(classes):
        found = load_pictures(path, limit=share, progress=progress)
        pictures += found
        labels += [label] * len(found)
    return LabelledPictures(tuple(pictures), tuple(labels), tuple(path.name for path in classes))


def _folders_with_pictures(source: Path) -> list[Path]:
    """Return the folder itself, or the folders in it where it holds nothing but folders."""
    if not source.is_dir():
        return [source]
    entries = sorted(path for path in source.iterdir() if not path.name.startswith("."))
    if not entries:
        raise DataMissingError(f"{source}: an empty folder; expected picture files")
    inner = [path for path in entries if path.is_dir()]
    if len(inner) < len(entries):
        return [source]
    return [folder for path in inner for folder in _folders_with_pictures(path)]


def _fitting(picture: ImageArray) -> ImageArray:
    """Return the picture, made smaller where its longest side is longer than is kept."""
    height, width = picture.shape[:2]
    scale = LARGEST_SIDE / max(height, width)
    if scale >= 1:
        return picture
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
