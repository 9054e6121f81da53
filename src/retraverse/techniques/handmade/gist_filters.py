"""The filters of GIST: contrast normalisation before it, and the bank of oriented band-passes.

Conventions: pictures are float32 (side, side); frequencies are in cycles a pixel; a *centred*
spectrum has frequency 0 at index N / 2 of both axes.

How it is fast, with the same answer as transforming everything in full:

- The low-pass of the normalisation keeps 4 cycles a picture: 41 waves an axis hold all of it, so
  it is two thin matrix products and no Fourier transform (`LowPass`).
- A filter passes only part of the spectrum. Only that part is transformed back, to a coarser
  grid (`BandPass`). Moving a band in the spectrum leaves the magnitude as it is, so the part need
  not lie around frequency 0. Block means on the coarse grid are those of the magnitude's
  Fourier interpolation at every pixel.

Source: see `retraverse.techniques.gist`.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from retraverse.types import Array, FloatArray

__all__ = [
    "BORDER",
    "GRID",
    "ORIENTATIONS",
    "SCALES",
    "BandPass",
    "LowPass",
    "Transforms",
    "filter_bank",
    "normalise_contrast",
    "transfer",
]

Transforms = Literal["cropped", "full"]

SCALES, ORIENTATIONS, GRID = 4, 8, 4
BORDER = 32
"""Pixels mirrored around the picture before filtering."""
CUTOFF_CYCLES = 4
"""The low-pass of the contrast normalisation halves this many cycles a picture."""
CONTRAST_FLOOR = np.float32(0.2)
_NORMALISING_BORDER = 5
_MOST_WAVES = 20
_NEGLIGIBLE = 1e-3
"""Frequencies at which a filter's gain is lower do not count towards its band."""
_MARGIN = 1.2
"""So much more than its band is kept of each axis: the magnitude is rougher than the signal."""
_LEAST_SAMPLES = 16
"""A block is sampled at least so often along each side, where it has as many pixels."""


def transfer(scale: int, orientation: int, fy: Array, fx: Array) -> NDArray[np.float64]:
    """Return the gain of one filter at frequencies (fy, fx) in cycles a pixel; 1 at its centre.

    ``exp(-3.5 (f / f0 - 1)^2 - 2 pi angle^2)`` with ``f0 = 0.3 / 1.85^scale``, f the
    frequency's length and angle (in -pi..pi) its direction less the filter's,
    -pi orientation / 8.
    """
    centre = 0.3 / 1.85**scale
    radius = np.hypot(fy, fx)
    turned = np.arctan2(fy, fx) + np.pi * orientation / ORIENTATIONS
    angle = np.where(turned > np.pi, turned - 2 * np.pi, turned)
    gain: NDArray[np.float64] = np.exp(-3.5 * (radius / centre - 1) ** 2 - 2 * np.pi * angle**2)
    return gain


class LowPass:
    """A periodic Gaussian low-pass of square pictures of one size.

    The gain at k cycles a picture (both axes: k^2 = ky^2 + kx^2) is
    ``exp(-k^2 ln 2 / CUTOFF_CYCLES^2)``. Waves beyond `_MOST_WAVES`, which it lets through by
    3e-8, are left out.
    """

    def __init__(self, side: int) -> None:
        waves = np.arange(1, min(_MOST_WAVES, (side - 1) // 2) + 1)
        phase = 2 * np.pi * np.outer(np.arange(side), waves) / side
        parts = [np.full((side, 1), np.sqrt(0.5)), np.cos(phase), np.sin(phase)]
        cycles = np.concatenate([[0], waves, waves])
        if side % 2 == 0 and side // 2 <= _MOST_WAVES:
            parts.append(np.cos(np.pi * np.arange(side))[:, np.newaxis] * np.sqrt(0.5))
            cycles = np.append(cycles, side // 2)
        self._waves: FloatArray = (np.hstack(parts) * np.sqrt(2 / side)).astype(np.float32)
        gain = np.exp(-(cycles**2) * np.log(2) / CUTOFF_CYCLES**2)
        self._gain: FloatArray = np.outer(gain, gain).astype(np.float32)

    def __call__(self, picture: FloatArray) -> FloatArray:
        """Return the picture's slow part."""
        waves = self._waves
        passed = waves @ ((waves.T @ picture @ waves) * self._gain) @ waves.T
        return np.asarray(passed, dtype=np.float32)


def normalise_contrast(picture: FloatArray, low_pass: LowPass) -> FloatArray:
    """Return log(1 + picture) less its local mean, over its local standard deviation.

    Parameters
    ----------
    picture : float32 array, shape (S, S)
        Grey levels from 0.
    low_pass : LowPass
        Of size S + 10: what "local" means.
    """
    import cv2

    border = _NORMALISING_BORDER
    logs = cv2.copyMakeBorder(np.log1p(picture), border, border, border, border, cv2.BORDER_REFLECT)
    levels = np.asarray(logs, dtype=np.float32)
    detail = levels - low_pass(levels)
    spread = np.sqrt(np.abs(low_pass(detail * detail)))
    normalised = detail / (CONTRAST_FLOOR + spread)
    return np.asarray(normalised[border:-border, border:-border], dtype=np.float32)


@dataclass(frozen=True)
class BandPass:
    """One filter of the bank for pictures of one size, and where its band lies."""

    rows: slice
    """Of the centred spectrum, h of them."""
    columns: slice
    """w of them."""
    gain: FloatArray
    """(h, w), over the number of pixels: the scale of the inverse transform."""
    row_weights: FloatArray
    """(GRID, h): how much each row of the coarse grid counts in each row of blocks."""
    column_weights: FloatArray
    """(w, GRID)."""

    def block_means(self, spectrum: Array) -> FloatArray:
        """Return the mean magnitude of the filtered picture in each block, (GRID, GRID).

        Parameters
        ----------
        spectrum : complex64 array, shape (N, N)
            Centred.
        """
        import cv2

        band = spectrum[self.rows, self.columns] * self.gain
        parts = band.view(np.float32).reshape(*band.shape, 2)
        filtered = np.asarray(cv2.dft(parts, flags=cv2.DFT_INVERSE), np.float32)
        magnitude = np.abs(filtered.view(np.complex64)[..., 0])
        means: FloatArray = self.row_weights @ magnitude @ self.column_weights
        return means


@functools.lru_cache(maxsize=8)
def filter_bank(resolution: int, transforms: Transforms) -> tuple[LowPass, tuple[BandPass, ...]]:
    """Return the low-pass and the 32 filters (scale by scale) for pictures of this side."""
    low_pass = LowPass(resolution + 2 * _NORMALISING_BORDER)
    return low_pass, tuple(_band_passes(resolution, transforms))


def _band_passes(resolution: int, transforms: Transforms) -> Iterator[BandPass]:
    n = resolution + 2 * BORDER
    frequencies = np.arange(-n // 2, n // 2) / n
    for scale in range(SCALES):
        for orientation in range(ORIENTATIONS):
            low, high = _band(scale, orientation)
            rows, columns = (
                slice(0, n) if transforms == "full" else _indices(*edges, resolution, n)
                for edges in zip(low, high, strict=True)
            )
            gain = transfer(scale, orientation, frequencies[rows, np.newaxis], frequencies[columns])
            yield BandPass(
                rows,
                columns,
                (gain / n**2).astype(np.float32),
                _block_weights(resolution, rows.stop - rows.start),
                np.ascontiguousarray(_block_weights(resolution, columns.stop - columns.start).T),
            )


@functools.cache
def _band(scale: int, orientation: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the lowest and highest (fy, fx) at which a filter's gain is not negligible."""
    frequencies = np.linspace(-0.5, 0.5, 257)
    passed = transfer(scale, orientation, frequencies[:, np.newaxis], frequencies) > _NEGLIGIBLE
    edges = [frequencies[np.flatnonzero(passed.any(axis=axis))[[0, -1]]] for axis in (1, 0)]
    (bottom, top), (left, right) = edges
    return (float(bottom), float(left)), (float(top), float(right))


def _indices(low: float, high: float, resolution: int, n: int) -> slice:
    """Return the part of a centred axis that holds a band and is transformed fast."""
    import cv2

    first, last = int(np.floor((low + 0.5) * n)), int(np.ceil((high + 0.5) * n))
    least = _LEAST_SAMPLES * GRID * n / resolution
    size = cv2.getOptimalDFTSize(int(max(_MARGIN * (last - first + 1), least)))
    if size >= n:
        return slice(0, n)
    start = min(max(0, (first + last - size) // 2), n - size)
    return slice(start, start + size)


def _block_weights(resolution: int, n_samples: int) -> FloatArray:
    """Return float32 (GRID, n_samples): the mean over each block's pixels, from samples.

    Samples are taken at equal distances along the picture with its border; between them the
    function that is averaged is interpolated by waves, the fewest that pass through all samples.
    """
    n, block = resolution + 2 * BORDER, resolution // GRID
    waves = np.fft.fftfreq(n_samples) * n_samples / n
    pixels = BORDER + np.arange(resolution)
    means = np.exp(2j * np.pi * np.outer(pixels, waves)).reshape(GRID, block, -1).mean(axis=1)
    places = np.arange(n_samples) * n / n_samples
    weights = (means @ np.exp(-2j * np.pi * np.outer(waves, places))).real / n_samples
    return np.ascontiguousarray(weights, dtype=np.float32)
