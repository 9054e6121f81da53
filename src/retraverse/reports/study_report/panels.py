"""Drawing: lines, points, rows of dots and bars, one panel each, in the style of all reports.

A line is told from the others by colour, mark and dash together. Every mark is a run; the page
finds it again by the panel's span and the values it carries.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from retraverse.reports.study_report.artefacts import Line, Panel, slug
from retraverse.reports.study_report.series import Series
from retraverse.reports.svg import COLOURS, Plot, drawing, export, panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["MARKS", "draw_bars", "draw_dots", "draw_lines", "mark_of"]

MARKS = ("o", "s", "^", "D", "v", "P", "X")
"""Marks of the lines in turn."""
_N_COLOURS = sum(name.startswith("series-") for name in COLOURS)
_SIZE = (400, 280)
_TICK_LETTERS = 56
"""Names of steps that are longer, all together, stand aslant."""
_MARKED_POINTS = 24
"""Lines of more points are drawn without a mark at each."""


def mark_of(series: Series) -> tuple[str, str, bool]:
    """Return a line's colour name, mark and whether it is dashed."""
    colour = series.index % _N_COLOURS
    turn = series.index // _N_COLOURS
    return f"series-{colour}", MARKS[(colour + turn) % len(MARKS)], turn % 2 == 1


def draw_lines(
    title: str,
    note: str,
    lines: Sequence[Line],
    *,
    name: str,
    x_label: str,
    y_label: str,
    x_ticks: Sequence[str] = (),
    is_log: tuple[bool, bool] = (False, False),
    y_limits: tuple[float, float] | None = None,
    is_joined: bool = True,
) -> Panel:
    """Return a panel of lines, or of points alone; values that are NaN are left out.

    `name` tells the figure from the others of its page.
    """
    shown = [kept for line in lines if (kept := _finite(line, is_log)).x]
    slanted = sum(map(len, x_ticks)) > _TICK_LETTERS
    room = 3.4 * max(map(len, x_ticks)) if slanted else 0.0
    with drawing(f"lines-{slug(name)}-{slug(title)}"):
        figure, axes = panel(_SIZE[0], _SIZE[1] + room, left=56, bottom=44 + room)
        for line in shown:
            _draw_line(axes, line, is_joined=is_joined, has_steps=bool(x_ticks))
        axes.set(xlabel=x_label, ylabel=y_label)
        axes.grid(axis="both" if not is_joined else "y")
        _set_scales(axes, shown, x_ticks, is_log, y_limits)
        if slanted:
            axes.tick_params(axis="x", labelrotation=40, labelrotation_mode="anchor")
            for label in axes.get_xticklabels():
                label.set_horizontalalignment("right")
        plot = _indexed(export(figure, axes, _alt(title, shown, x_label, y_label, x_ticks)))
    return Panel(title, note, plot, tuple(shown), x_label, y_label, tuple(x_ticks), is_log)


def draw_dots(
    title: str,
    note: str,
    lines: Sequence[Line],
    *,
    name: str,
    x_label: str,
    is_log: bool = False,
) -> Panel:
    """Return a panel of one row per series: its value in `Line.x`, `Line.y` is set to the row."""
    kept = [line for line in lines if line.x and math.isfinite(line.x[0])]
    rows = [
        Line(line.series, line.x[:1], (float(row),), line.runs[:1], line.low[:1], line.high[:1])
        for row, line in enumerate(kept)
    ]
    names = [_shortened(line.series.label) for line in rows]
    left = min(190.0, 6.4 * max((len(name) for name in names), default=6) + 16)
    with drawing(f"dots-{slug(name)}-{slug(title)}"):
        figure, axes = panel(_SIZE[0], 62 + 24 * max(len(rows), 2), left=left)
        for line in rows:
            if line.low:
                _draw_interval(axes, line)
            axes.plot(line.x, line.y, linestyle="", **_mark(line.series, 7.5))
        axes.set_yticks(range(len(rows)), names)
        axes.tick_params(axis="y", length=0, labelcolor=COLOURS["ink"])
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_xlabel(x_label)
        axes.grid(axis="x")
        if is_log:
            axes.set_xscale("log")
            _plain_powers(axes.xaxis)
        elif "%" in x_label:
            axes.set_xlim(-2, 103)
        elif rows:
            axes.set_xlim(0, 1.06 * max(line.x[0] for line in rows) or 1)
        plot = _indexed(export(figure, axes, _dots_alt(title, rows, x_label)))
    return Panel(title, note, plot, tuple(rows), x_label, "", (), (is_log, False))


def draw_bars(
    title: str, note: str, line: Line, *, name: str, x_label: str, y_label: str, mean: float
) -> Panel:
    """Return a panel of bars, all of one run, with its mean as a dashed line."""
    with drawing(f"bars-{slug(name)}-{slug(title)}"):
        figure, axes = panel(*_SIZE, left=56)
        colour = COLOURS[mark_of(line.series)[0]]
        axes.bar(line.x, line.y, width=0.82, color=colour, linewidth=0)
        axes.axvline(mean, color=COLOURS["ink"], lw=1.2, dashes=(4, 2))
        axes.set(xlabel=x_label, ylabel=y_label)
        axes.grid(axis="y")
        _whole_numbers(axes.xaxis)
        alt = (
            f"{title}: {y_label.lower()} by {x_label.lower()}, {min(line.x):g} to "
            f"{max(line.x):g}, mean {mean:.2f}."
        )
        plot = export(figure, axes, alt)
    return Panel(title, note, plot, (line,), x_label, y_label)


def _indexed(plot: Plot) -> Plot:
    """Return a drawing in whose labels the field's indices are set as such: t_VPR, P_R100."""
    low = r'\1<tspan dy="2.5" style="font-size: .75em">\2</tspan><tspan dy="-2.5">\3</tspan></text>'
    svg = re.sub(r"\b([tPR])_([A-Za-z0-9]+)([^<]*)</text>", low, str(plot.svg))
    return replace(plot, svg=Markup(svg))


def _finite(line: Line, is_log: tuple[bool, bool]) -> Line:
    """Return the line without the points that cannot be drawn."""
    kept = [
        at
        for at, point in enumerate(zip(line.x, line.y, strict=True))
        if all(
            math.isfinite(value) and (value > 0 or not log)
            for value, log in zip(point, is_log, strict=True)
        )
    ]

    def of(values: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(values[at] for at in kept) if values else ()

    return Line(line.series, of(line.x), of(line.y), of(line.runs), of(line.low), of(line.high))


def _mark(series: Series, size: float) -> dict[str, Any]:
    colour, mark, _ = mark_of(series)
    return {
        "color": COLOURS[colour],
        "marker": mark,
        "ms": size,
        "mec": COLOURS["surface"],
        "mew": 0.7,
        "gid": f"layer-{slug(series.technique)}",
    }


def _with_gaps(line: Line) -> tuple[list[float], list[float]]:
    """Return a line along steps with a break where steps are missing: nothing was found there."""
    x: list[float] = []
    y: list[float] = []
    for at, value in zip(line.x, line.y, strict=True):
        if x and at - x[-1] > 1:
            x.append(x[-1] + 1)
            y.append(math.nan)
        x.append(at)
        y.append(value)
    return x, y


def _draw_line(axes: "Axes", line: Line, *, is_joined: bool, has_steps: bool) -> None:
    style = _mark(line.series, 6.5)
    if is_joined and len(line.x) > _MARKED_POINTS:
        style |= {"markevery": max(1, len(line.x) // 8), "ms": 5.5}
    width = 1.7 if is_joined else 0.0
    dashes: Any = (4, 2) if mark_of(line.series)[2] else (None, None)
    x, y = _with_gaps(line) if has_steps else (line.x, line.y)
    axes.plot(x, y, lw=width, dashes=dashes, zorder=3, **style)
    if line.low and len(line.x) <= _MARKED_POINTS and is_joined:
        axes.fill_between(
            line.x,
            line.low,
            line.high,
            color=style["color"],
            alpha=0.12,
            linewidth=0,
            gid=style["gid"],
        )


def _draw_interval(axes: "Axes", line: Line) -> None:
    axes.plot(
        (line.low[0], line.high[0]),
        (line.y[0], line.y[0]),
        color=COLOURS[mark_of(line.series)[0]],
        lw=2,
        alpha=0.45,
        gid=f"layer-{slug(line.series.technique)}",
    )


def _set_scales(
    axes: "Axes",
    lines: Sequence[Line],
    x_ticks: Sequence[str],
    is_log: tuple[bool, bool],
    y_limits: tuple[float, float] | None,
) -> None:
    if x_ticks:
        axes.set_xticks(range(len(x_ticks)), x_ticks)
        axes.set_xlim(-0.3, len(x_ticks) - 0.7)
    elif is_log[0]:
        axes.set_xscale("log")
        _plain_powers(axes.xaxis)
    elif all(float(x).is_integer() for line in lines for x in line.x):
        _whole_numbers(axes.xaxis)
    if y_limits is not None and y_limits[1] > 100:
        axes.set_yticks(range(0, 101, 20))
    elif lines and all(float(y).is_integer() for line in lines for y in line.y):
        _whole_numbers(axes.yaxis)
    if is_log[1]:
        axes.set_yscale("log")
        _plain_powers(axes.yaxis)
    elif y_limits is not None:
        axes.set_ylim(*y_limits)
    elif lines and min(y for line in lines for y in line.y) >= 0:
        axes.set_ylim(0, 1.06 * max(y for line in lines for y in line.y) or 1)


def _plain_powers(axis: Any) -> None:
    """Write 0.01, 0.1, 1, 10 along a logarithmic axis, and 2 and 5 where there is room."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    narrow = low > 0 and math.log10(high / low) < 2.3
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if narrow else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_minor_formatter(NullFormatter())


def _whole_numbers(axis: Any) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins=6, integer=True, min_n_ticks=1, steps=[1, 2, 5, 10]))


def _shortened(label: str, longest: int = 27) -> str:
    return label if len(label) <= longest else label[: longest - 1] + "…"


def _alt(
    title: str, lines: Sequence[Line], x_label: str, y_label: str, x_ticks: Sequence[str]
) -> str:
    if not lines:
        return f"{title}: nothing to draw."

    def at(x: float) -> str:
        return x_ticks[int(x)] if x_ticks else f"{x:g}"

    ends = "; ".join(
        f"{line.series.label} {line.y[0]:.3g} at {at(line.x[0])}"
        + (f", {line.y[-1]:.3g} at {at(line.x[-1])}" if len(line.x) > 1 else "")
        for line in lines[:8]
    )
    more = f"; and {len(lines) - 8} more" if len(lines) > 8 else ""
    return f"{title}: {y_label} over {x_label}. {ends}{more}."


def _dots_alt(title: str, lines: Sequence[Line], x_label: str) -> str:
    values = "; ".join(f"{line.series.label} {line.x[0]:.3g}" for line in lines)
    return f"{title}: {x_label}. {values or 'nothing to draw'}."
