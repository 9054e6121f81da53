"""How large writing must be in a picture to be read after it was shrunk and compressed.

A measured stand-in for visual privacy that needs no picture of anybody: characters of a number
plate are drawn into made-up scenes, the scenes are resized and compressed, and a reader who knows
everything but the character itself (font, place, size, and the shrinking) picks the likeliest of
36 by normalised correlation. What this reader can read, somebody else may
still fail at; what it cannot read is lost to most. It says nothing about faces, nor about somebody
who puts many pictures of one plate together.

Conventions
- Scenes are square, 512 px, before they are shrunk; heights are shares of the side.
- Chance is 1 / 36. A height is *legible* if at least 90 % of its characters are read.
"""

import string
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from retraverse.errors import ConfigError
from retraverse.images import Frame, Worsening, worsen_frame
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["CHARACTERS", "LEGIBLE", "Reading", "read_characters", "smallest_legible_height"]

CHARACTERS = string.digits + string.ascii_uppercase
LEGIBLE = 0.9
"""Share of characters that must be read."""
SOURCE_SIDE = 512
SMALLEST, LARGEST = 0.008, 0.25
"""Character heights that can be drawn and read, as shares of the side."""
_STROKE_SHARE = 7
"""Character height over stroke width, as on number plates."""
_SUPERSAMPLING = 4
_PAPER, _INK = 215, 30


@dataclass(frozen=True)
class Reading:
    """How many characters of one height were read."""

    height: float
    """Character height as a share of the picture's side."""
    read_share: float
    n_characters: int


def read_characters(
    height: float, worsening: Worsening, *, n_characters: int = 36, seed: int = 0
) -> Reading:
    """Return the share of characters of one height that can be read in worse pictures.

    Parameters
    ----------
    height : float in [0.008, 0.25]
        Character height as a share of the picture's side.
    worsening : Worsening
        What is done to the scenes.
    n_characters : int
        How many are drawn and read, each of the 36 as often as the others, if it divides.
    seed : int
        Of scenes, places and order.

    Raises
    ------
    ConfigError
        If the height is outside its range.
    """
    if not SMALLEST <= height <= LARGEST:
        raise ConfigError(
            f"character height: got {height}, expected {SMALLEST} to {LARGEST} of the side"
        )
    random = np.random.default_rng(seed)
    pixels = round(height * SOURCE_SIDE)
    places = _grid(pixels)
    wanted = np.resize(random.permutation(len(CHARACTERS)), n_characters)
    n_right = 0
    for start in range(0, n_characters, len(places)):
        batch = wanted[start : start + len(places)]
        shift = random.integers(0, _room(pixels), 2)
        spots = [(y + int(shift[0]), x + int(shift[1])) for y, x in places[: len(batch)]]
        scene = _scene(random)
        for (y, x), character in zip(spots, batch.tolist(), strict=True):
            tile = _tile(character, pixels)
            scene[y : y + tile.shape[0], x : x + tile.shape[1]] = tile[..., np.newaxis]
        n_right += int((_read(scene, spots, pixels, worsening) == batch).sum())
    return Reading(height, n_right / n_characters, n_characters)


def smallest_legible_height(
    worsening: Worsening, *, n_characters: int = 36, seed: int = 0, steps: int = 6
) -> float:
    """Return the smallest character height that is read to 90 %, as a share of the side.

    Found by halving the logarithm of the height between 0.008 and 0.25, to about 6 % of itself.
    Infinity if even characters of 0.25 cannot be read.
    """
    low, high = np.log(SMALLEST), np.log(LARGEST)

    def is_legible(height: float) -> bool:
        reading = read_characters(height, worsening, n_characters=n_characters, seed=seed)
        return reading.read_share >= LEGIBLE

    if not is_legible(LARGEST):
        return float("inf")
    for _ in range(steps):
        middle = (low + high) / 2
        low, high = (low, middle) if is_legible(float(np.exp(middle))) else (middle, high)
    return float(np.exp(high))


def _grid(pixels: int) -> list[tuple[int, int]]:
    """Return upper left corners of tiles, apart from one another, that leave room for a shift."""
    tile = _tile_side(pixels)
    starts = range(0, SOURCE_SIDE - tile - _room(pixels) + 1, tile + 8)
    return [(y, x) for y in starts for x in starts]


def _room(pixels: int) -> int:
    """By how much the places of a scene are shifted at random, in source pixels."""
    return max(2, pixels // 4)


def _tile_side(pixels: int) -> int:
    return 3 * pixels // 2


@lru_cache(maxsize=512)
def _tile(character: int, pixels: int) -> ImageArray:
    """Return one character in the middle of a piece of plate, antialiased."""
    import cv2

    font, text = cv2.FONT_HERSHEY_SIMPLEX, CHARACTERS[character]
    fine = pixels * _SUPERSAMPLING
    stroke = max(1, fine // _STROKE_SHARE)
    scale = cv2.getFontScaleFromHeight(font, fine - stroke, stroke)
    (width, height), _ = cv2.getTextSize(text, font, scale, stroke)
    side = _tile_side(pixels) * _SUPERSAMPLING
    tile = np.full((side, side), _PAPER, np.uint8)
    corner = ((side - width) // 2, (side + height) // 2)
    cv2.putText(tile, text, corner, font, scale, _INK, stroke, cv2.LINE_AA)
    small = (_tile_side(pixels), _tile_side(pixels))
    return np.asarray(cv2.resize(tile, small, interpolation=cv2.INTER_AREA), np.uint8)


def _scene(random: np.random.Generator) -> ImageArray:
    """Return a coloured scene with shapes of every size, so that JPEG has something to hold."""
    import cv2

    scene = np.zeros((SOURCE_SIDE, SOURCE_SIDE, 3), np.float32)
    for side in (4, 16, 64, 256):
        noise = random.normal(0, 24, (side, side, 3)).astype(np.float32)
        scene += cv2.resize(noise, (SOURCE_SIDE, SOURCE_SIDE), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(scene + 110, 0, 255), np.uint8)


def _read(
    scene: ImageArray, spots: list[tuple[int, int]], pixels: int, worsening: Worsening
) -> Array:
    """Return the likeliest character at every spot of a scene that was made worse."""
    seen = _worse_grey(scene, worsening)
    without_jpeg = Worsening(worsening.resize, worsening.resizer)
    # The reader draws every candidate at every spot and shrinks it as the picture was shrunk.
    scores = np.empty((len(CHARACTERS), len(spots)))
    for character in range(len(CHARACTERS)):
        drawn = np.full((SOURCE_SIDE, SOURCE_SIDE), _PAPER, np.uint8)
        tile = _tile(character, pixels)
        for y, x in spots:
            drawn[y : y + tile.shape[0], x : x + tile.shape[1]] = tile
        expected = _worse_grey(drawn, without_jpeg)
        for column, (y, x) in enumerate(spots):
            window = _window(y, x, tile.shape[0], len(expected))
            scores[character, column] = _correlation(expected[window], seen[window])
    return np.asarray(scores.argmax(axis=0))


def _worse_grey(picture: ImageArray, worsening: Worsening) -> FloatArray:
    grey = worsen_frame(Frame.from_array(picture), worsening).frame.grey()
    return grey.astype(np.float32)


def _window(y: int, x: int, side: int, picture_side: int) -> tuple[slice, slice]:
    """Return the pixels of a shrunk picture that a tile reaches, at least one."""
    scale = picture_side / SOURCE_SIDE
    ends = [(int(start * scale), int(np.ceil((start + side) * scale))) for start in (y, x)]
    return slice(*ends[0]), slice(*ends[1])


def _correlation(expected: FloatArray, seen: FloatArray) -> float:
    one, other = expected - expected.mean(), seen - seen.mean()
    size = float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum()) / size if size > 0 else 0.0
