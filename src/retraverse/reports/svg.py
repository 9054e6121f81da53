"""Figures as small inline SVG: one style, one palette, the same bytes every time.

Colours are drawn as fixed values and then exchanged for CSS variables, so that a figure
follows the page it stands in (light, dark, print). Text stays text.
"""

import base64
import io
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from retraverse.reports.lean_svg import lean_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "COLOURS",
    "MANY_POINTS",
    "Plot",
    "Span",
    "drawing",
    "export",
    "panel",
    "standalone",
]

COLOURS = {
    "ink": "#1b2431",
    "muted": "#5a6573",
    "grid": "#dde3ea",
    "surface": "#fefefe",
    "correct": "#0072b3",
    "wrong": "#d55e01",
    "truth": "#009e74",
    "series-0": "#0072b4",
    "series-1": "#d55e02",
    "series-2": "#009e75",
    "series-3": "#cc79a6",
    "series-4": "#b77d01",
    "series-5": "#56b4e8",
    "series-6": "#4d5866",
}
"""CSS variable -> the value drawn in its place; safe for the usual colour blindnesses."""

MANY_POINTS = 1500
"""From here on, marks are drawn as one picture instead of one shape each."""

_STYLE: dict[str, object] = {
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 11,
    "text.color": COLOURS["ink"],
    "text.parse_math": False,
    "axes.edgecolor": COLOURS["muted"],
    "axes.labelcolor": COLOURS["ink"],
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "axes.axisbelow": True,
    "axes.labelpad": 5,
    "grid.color": COLOURS["grid"],
    "grid.linewidth": 0.8,
    "xtick.color": COLOURS["muted"],
    "ytick.color": COLOURS["muted"],
    "xtick.labelcolor": COLOURS["muted"],
    "ytick.labelcolor": COLOURS["muted"],
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "image.composite_image": False,
    "hatch.linewidth": 0.6,
}


@dataclass(frozen=True)
class Span:
    """Where one panel's data lie in its figure, for marks that the page lays over it."""

    left: float
    """Left edge of the panel, fraction of the figure's width."""
    top: float
    """Upper edge, fraction of the figure's height."""
    width: float
    height: float
    x: tuple[float, float]
    """Data values at the left and right edge."""
    y: tuple[float, float]
    """Data values at the upper and lower edge."""


@dataclass(frozen=True)
class Plot:
    """A figure ready for a page."""

    svg: Markup
    alt: str
    """What it shows, for those who cannot see it."""
    span: Span

    @property
    def span_data(self) -> Markup:
        """Return the span as JSON for an attribute in single quotes."""
        found = self.span
        values = {
            **{name: round(getattr(found, name), 4) for name in ("left", "top", "width", "height")},
            "x": [float(f"{value:.9g}") for value in found.x],
            "y": [float(f"{value:.9g}") for value in found.y],
        }
        return Markup(json.dumps(values, separators=(",", ":")))  # numbers alone: nothing to escape


@contextmanager
def drawing(name: str) -> Iterator[None]:
    """Draw in the report's style while the block lasts; `name` keeps figures' marks apart."""
    from matplotlib import style

    with style.context(["default", {**_STYLE, "svg.hashsalt": f"retraverse-{name}"}]):
        yield


def panel(
    width: float, height: float, *, left: float = 48, right: float = 12, bottom: float = 44
) -> "tuple[Figure, Axes]":
    """Return a figure of `width` x `height` SVG units and its one panel inside the margins."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, height / 72))
    top = 8
    axes = figure.add_axes(
        (
            left / width,
            bottom / height,
            (width - left - right) / width,
            (height - top - bottom) / height,
        )
    )
    return figure, axes


def export(figure: "Figure", axes: "Axes", alt: str) -> Plot:
    """Return `figure` as inline SVG with `alt` as its accessible name."""
    buffer = io.StringIO()
    nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
    figure.savefig(buffer, format="svg", metadata=nothing, dpi=144)
    return Plot(Markup(_inline(buffer.getvalue(), alt)), alt, _span(axes))


def standalone(plot: Plot) -> str:
    """Return a figure as the text of an SVG file of its own, in the light page's colours."""
    text = re.sub(r"var\(--([a-z0-9-]+)\)", lambda found: COLOURS[found[1]], str(plot.svg))
    # Not every program that takes SVG knows the plain name yet.
    text = re.sub(r"<(use|image) href=", r"<\1 xlink:href=", text)
    spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    head = f'<?xml version="1.0" encoding="utf-8"?>\n<svg {spaces} '
    return text.replace("<svg ", head, 1) + "\n"


def _span(axes: "Axes") -> Span:
    box = axes.get_position()
    bottom, top = axes.get_ylim()
    return Span(box.x0, 1 - box.y1, box.width, box.height, axes.get_xlim(), (top, bottom))


def _inline(text: str, alt: str) -> str:
    lean = lean_svg(text, alt)
    lean = re.sub(r"data:image/png;base64,([A-Za-z0-9+/=]+)", _lean_png, lean)
    for name, value in COLOURS.items():
        lean = lean.replace(value, f"var(--{name})")
    return lean


def _lean_png(match: re.Match[str]) -> str:
    """Return a PNG of few colours as one with a palette: the same pixels in fewer bytes."""
    from PIL import Image

    with Image.open(io.BytesIO(base64.b64decode(match[1]))) as image:
        pixels = np.asarray(image.convert("RGBA"))
    packed = np.ascontiguousarray(pixels).view(np.uint32)[..., 0]
    colours, indices = np.unique(packed, return_inverse=True)
    if len(colours) > 256:
        return match[0]
    lean = Image.fromarray(indices.reshape(packed.shape).astype(np.uint8), "P")
    channels = colours.view(np.uint8).reshape(-1, 4)
    lean.putpalette(channels[:, :3].tobytes())
    buffer = io.BytesIO()
    lean.save(buffer, "PNG", optimize=True, transparency=channels[:, 3].tobytes())
    return f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"
