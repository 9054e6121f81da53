"""The similarity matrix with the matched path and the true band over it."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from retraverse.datasets import GroundTruth
from retraverse.reports.svg import COLOURS, MANY_POINTS, Plot, drawing, export, panel
from retraverse.reports.windows import Window
from retraverse.studies.comparison_record import ComparisonRecord
from retraverse.types import Array, BoolArray, FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["RAMP", "MatrixFigure", "MatrixPicture", "matrix_figure", "matrix_picture"]

RAMP = ("#10151c", "#3b4754", "#7f8b97", "#c5ccd3", "#ffffff")
"""Colours of low to high scores: dark to light, so that coloured marks stand out on all of it."""

_MATCHED = "#2f9bff"
_ASTRAY = "#ff8a1f"
_TRUE = "#2fe0a6"
_MAX_CELLS = 512
"""Longest side of the drawn matrix; longer ones are averaged in blocks."""
_LEVELS = 64


@dataclass(frozen=True)
class MatrixFigure:
    """The figure, and what its caption must say."""

    plot: Plot
    low: float
    """Scores up to this one are drawn darkest."""
    high: float
    """Scores from this one on are drawn lightest."""
    block: tuple[int, int]
    """Query and reference frames that share one drawn cell."""


def matrix_figure(record: ComparisonRecord, windows: Sequence[Window]) -> MatrixFigure:
    """Draw the single-frame scores, rows = query frames downwards, with the answers on top."""
    shape = n_queries, n_references = record.similarity.shape
    cells, block = _averaged(record.similarity)
    low, high = _limits(cells)
    width, left, right = 620, 56, 12
    side = width - left - right
    height = side * min(max(n_queries / max(n_references, 1), 0.4), 1.15) + 52
    with drawing("matrix"):
        figure, axes = panel(width, height, left=left, right=right)
        _draw_cells(axes, cells, shape, low, high)
        if record.truth is not None:
            _draw_truth(axes, _true_cells(record.truth, shape, block), shape)
        _draw_answers(axes, windows, n_queries)
        axes.set_xlim(-0.5, n_references - 0.5)
        axes.set_ylim(n_queries - 0.5, -0.5)
        _label(axes)
        plot = export(figure, axes, _alt(record, windows))
    return MatrixFigure(plot, low, high, block)


def _alt(record: ComparisonRecord, windows: Sequence[Window]) -> str:
    n_queries, n_references = record.similarity.shape
    n_wrong = sum(window.verdict == "wrong" for window in windows)
    return (
        f"Similarity matrix of {n_queries} query frames by {n_references} reference frames with "
        f"{sum(window.reference >= 0 for window in windows)} matches drawn over it"
        + (f", {n_wrong} of them wrong." if record.truth is not None else ".")
    )


@dataclass(frozen=True)
class MatrixPicture:
    """The cells of a matrix alone, for pages that lay the answers over it themselves."""

    png: bytes
    shape: tuple[int, int]
    """Query and reference frames of the whole matrix."""
    low: float
    high: float
    block: tuple[int, int]
    """As in `MatrixFigure`."""


def matrix_picture(similarity: FloatArray, *, longest: int = 256) -> MatrixPicture:
    """Draw the scores in the colours of `matrix_figure`, at most `longest` cells a side."""
    from PIL import Image

    cells, block = _averaged(similarity, longest)
    low, high = _limits(cells)
    levels = _LEVELS // 2
    shares = np.nan_to_num((cells - low) / (high - low), nan=0.0, posinf=1.0, neginf=0.0)
    image = Image.fromarray((np.clip(shares, 0, 1) * (levels - 1)).round().astype(np.uint8), "P")
    image.putpalette(_ramp_colours(levels))
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    shape = similarity.shape[0], similarity.shape[1]
    return MatrixPicture(buffer.getvalue(), shape, low, high, block)


def _ramp_colours(levels: int) -> bytes:
    """Return `levels` colours along the ramp, 3 bytes each."""
    stops = np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in RAMP])
    at = np.linspace(0, len(RAMP) - 1, levels)
    mixed = [np.interp(at, np.arange(len(RAMP)), channel) for channel in stops.T]
    return np.stack(mixed, axis=1).round().astype(np.uint8).tobytes()


def _averaged(matrix: FloatArray, longest: int = _MAX_CELLS) -> tuple[FloatArray, tuple[int, int]]:
    """Return the matrix as means over blocks, at most `longest` of them a side, and the block."""
    block = (-(-matrix.shape[0] // longest), -(-matrix.shape[1] // longest))
    if block == (1, 1):
        return matrix, block
    return _block_sums(matrix, block) / _block_sums(np.ones_like(matrix), block), block


def _block_sums(matrix: FloatArray, block: tuple[int, int]) -> FloatArray:
    rows = np.add.reduceat(matrix, np.arange(0, matrix.shape[0], block[0]), axis=0)
    sums = np.add.reduceat(rows, np.arange(0, matrix.shape[1], block[1]), axis=1)
    return np.asarray(sums, np.float32)


def _limits(cells: FloatArray) -> tuple[float, float]:
    """Return the scores where the ramp begins and ends: outliers must not flatten the rest."""
    finite = cells[np.isfinite(cells)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(value) for value in np.percentile(finite, (1, 99.7)))
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _draw_cells(
    axes: "Axes", cells: FloatArray, shape: tuple[int, int], low: float, high: float
) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    axes.imshow(
        cells,
        cmap=LinearSegmentedColormap.from_list("scores", RAMP, N=_LEVELS),
        vmin=low,
        vmax=high,
        extent=(-0.5, shape[1] - 0.5, shape[0] - 0.5, -0.5),
        interpolation="none",
        aspect="auto",
        gid="layer-scores",
    )


def _true_cells(truth: GroundTruth, shape: tuple[int, int], block: tuple[int, int]) -> BoolArray:
    """Return which drawn cells hold a true pair, with an empty border of one cell."""
    cells = np.zeros((-(-shape[0] // block[0]) + 2, -(-shape[1] // block[1]) + 2), np.bool_)
    for query, positives in enumerate(truth.positives):
        inside = positives[positives < shape[1]]
        cells[1 + query // block[0], 1 + inside // block[1]] = True
    return cells


def _draw_truth(axes: "Axes", cells: BoolArray, shape: tuple[int, int]) -> None:
    """Outline the true pairs; cell centres are mapped back to frame numbers."""
    if not cells.any():
        return
    rows, columns = cells.shape[0] - 2, cells.shape[1] - 2
    y = (np.arange(-1, rows + 1) + 0.5) * shape[0] / rows - 0.5
    x = (np.arange(-1, columns + 1) + 0.5) * shape[1] / columns - 0.5
    width = 1.4 if max(shape) <= _MAX_CELLS else 0.8
    outline = axes.contour(x, y, cells.astype(np.float32), [0.5], colors=_TRUE, linewidths=width)
    outline.set_gid("layer-truth")


def _draw_answers(axes: "Axes", windows: Sequence[Window], n_queries: int) -> None:
    size = float(np.clip(2400 / max(n_queries, 1), 3, 26))
    crowded = len(windows) > MANY_POINTS
    good = _points(windows, ("correct", "unknown"))
    wrong = _points(windows, ("wrong",))
    axes.scatter(
        good[:, 0],
        good[:, 1],
        s=size,
        c=_MATCHED,
        edgecolors="white",
        linewidths=0.4 if size > 6 else 0,
        rasterized=crowded,
        gid="layer-matches",
        zorder=3,
    )
    axes.scatter(
        wrong[:, 0],
        wrong[:, 1],
        s=size * 1.6,
        c=_ASTRAY,
        marker="x",
        linewidths=1.8 if size > 6 else 1.0,
        rasterized=crowded,
        gid="layer-matches",
        zorder=4,
    )


def _points(windows: Sequence[Window], verdicts: tuple[str, ...]) -> Array:
    chosen = [(w.reference, w.query) for w in windows if w.verdict in verdicts]
    return np.asarray(chosen, np.float64).reshape(-1, 2)


def _label(axes: "Axes") -> None:
    from matplotlib.ticker import MaxNLocator

    axes.set_xlabel("Reference frame (map)")
    axes.set_ylabel("Query frame")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=6, integer=True, min_n_ticks=1))
    axes.spines[["left", "bottom"]].set_color(COLOURS["grid"])
