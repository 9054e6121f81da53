"""The small figures: precision and recall, sequence lengths, and the score along the route."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from retraverse.reports.svg import COLOURS, MANY_POINTS, Plot, drawing, export, panel
from retraverse.reports.windows import Window
from retraverse.reports.wording import percent, plain, ratio
from retraverse.studies.comparison_record import ComparisonRecord, LengthPoint

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["accuracy_by_length", "length_histogram", "precision_recall", "route_figure"]

_SIZE = (400, 300)
"""Width and height of a small figure, SVG units."""
_MARKS: dict[str, dict[str, Any]] = {
    "correct": {"marker": "o", "color": COLOURS["correct"], "s": 14, "linewidths": 0},
    "unknown": {"marker": "o", "color": COLOURS["correct"], "s": 14, "linewidths": 0},
    "wrong": {"marker": "x", "color": COLOURS["wrong"], "s": 30, "linewidths": 1.8},
    "refused": {
        "marker": "o",
        "facecolors": COLOURS["surface"],
        "edgecolors": COLOURS["muted"],
        "s": 18,
        "linewidths": 1.1,
    },
}
"""How a window is drawn, by verdict: shape as well as colour tells them apart."""


def precision_recall(record: ComparisonRecord) -> Plot | None:
    """Draw precision over recall of the run and of single frames; None without ground truth."""
    result, single = record.evaluation, record.single_frame
    if result is None:
        return None
    with drawing("precision-recall"):
        figure, axes = panel(*_SIZE)
        if single is not None:
            axes.plot(
                single.recall, single.precision, color=COLOURS["muted"], lw=1.4, dashes=(4, 2)
            )
        axes.plot(result.recall, result.precision, color=COLOURS["correct"], lw=2.2)
        axes.set(xlim=(0, 1.01), ylim=(0, 1.03), xlabel="Recall", ylabel="Precision")
        axes.grid(axis="y")
        compared = f"; single frames {ratio(single.auc)}" if single is not None else ""
        alt = (
            f"Precision-recall curve; area under it {ratio(result.auc)}{compared}. "
            f"Precision at full recall {percent(result.p_r100)}."
        )
        return export(figure, axes, alt)


def length_histogram(record: ComparisonRecord) -> Plot | None:
    """Draw how many windows have which length; None if all have the same."""
    lengths = np.asarray(record.matches.sequence_length)
    if not len(lengths) or lengths.min() == lengths.max():
        return None
    values, counts = np.unique(lengths, return_counts=True)
    mean = record.times.mean_sequence_length
    with drawing("length-histogram"):
        figure, axes = panel(*_SIZE)
        axes.bar(values, counts, width=0.82, color=COLOURS["correct"], linewidth=0)
        axes.axvline(mean, color=COLOURS["ink"], lw=1.2, dashes=(4, 2))
        axes.set(xlabel="Sequence length K, frames", ylabel="Windows")
        axes.set_xlim(values[0] - 0.7, values[-1] + 0.7)
        axes.grid(axis="y")
        _whole_numbers(axes, x=True, y=True)
        alt = (
            f"Histogram of sequence lengths: {values[0]} to {values[-1]} frames, mean "
            f"{plain(mean)}, most often {values[counts.argmax()]} ({counts.max()} windows)."
        )
        return export(figure, axes, alt)


def accuracy_by_length(record: ComparisonRecord) -> Plot | None:
    """Draw accuracy and AUC for each fixed length; None with fewer than two of them."""
    points = record.lengths
    if len(points) < 2:
        return None
    x = [point.sequence_length for point in points]
    marks = "o" if len(points) <= 30 else ""
    with drawing("accuracy-by-length"):
        figure, axes = panel(*_SIZE)
        style = {"lw": 1.4, "dashes": (4, 2), "color": COLOURS["muted"]}
        axes.plot(x, [100 * point.auc for point in points], **style)  # type: ignore[arg-type]
        accuracy = [100 * point.accuracy for point in points]
        axes.plot(x, accuracy, color=COLOURS["correct"], lw=2.2, marker=marks, ms=4.5)
        if record.evaluation is not None:
            _mark_this_run(axes, record)
        axes.set(xlabel="Fixed sequence length K, frames", ylabel="Accuracy, AUC (%)")
        axes.set_ylim(_floor(points), 103)
        axes.set_xlim(x[0] - 0.02 * (x[-1] - x[0]) - 0.3, x[-1] + 0.02 * (x[-1] - x[0]) + 0.3)
        axes.grid(axis="y")
        _whole_numbers(axes, x=True)
        best = max(points, key=lambda point: point.accuracy)
        alt = (
            f"Accuracy over sequence length: {percent(points[0].accuracy)} at K = {x[0]}, "
            f"{percent(points[-1].accuracy)} at K = {x[-1]}, best {percent(best.accuracy)} at "
            f"K = {best.sequence_length}."
        )
        return export(figure, axes, alt)


def _mark_this_run(axes: "Axes", record: ComparisonRecord) -> None:
    assert record.evaluation is not None
    axes.scatter(
        [record.times.mean_sequence_length],
        [100 * record.evaluation.accuracy],
        marker="D",
        s=58,
        facecolors=COLOURS["surface"],
        edgecolors=COLOURS["wrong"],
        linewidths=2,
        zorder=5,
        clip_on=False,
    )


def _floor(points: Sequence[LengthPoint]) -> float:
    """Return where the axis of per cents begins: a multiple of 10 under all the points."""
    lowest = min(min(point.accuracy, point.auc) for point in points)
    return max(0.0, 10 * np.floor(10 * lowest) - 10) if np.isfinite(lowest) else 0.0


def route_figure(record: ComparisonRecord, windows: Sequence[Window], *, wide: bool) -> Plot:
    """Draw score, margin and, where it varies, sequence length along the query traverse."""
    width = 1000 if wide else 400
    lengths = [window.sequence_length for window in windows]
    varies = bool(lengths) and min(lengths) != max(lengths)
    shares = (3, 2, 1.6) if varies else (3, 2)
    height = (115 if wide else 120) * sum(shares) / 2.2
    with drawing(f"route-{'wide' if wide else 'narrow'}"):
        figure, whole = panel(width, height, left=54)
        rows = _stacked(whole, shares)
        _score_row(rows[0], record, windows)
        _margin_row(rows[1], windows)
        if varies:
            _length_row(rows[2], windows)
        for row in rows:
            _unanswered(row, record)
        for row in (whole, *rows):
            row.set_xlim(-0.5, max(record.matches.n_queries, 1) - 0.5)
            _whole_numbers(row, x=True)
        for row in rows[:-1]:
            row.tick_params(labelbottom=False)
        rows[-1].set_xlabel("Query frame")
        figure.align_ylabels(rows)
        return export(figure, whole, _route_alt(windows))


def _route_alt(windows: Sequence[Window]) -> str:
    if not windows:
        return "Score along the route: no window was answered."
    scores = [window.score for window in windows]
    n_wrong = sum(window.verdict == "wrong" for window in windows)
    n_refused = sum(window.verdict == "refused" for window in windows)
    return (
        f"Score and margin of {len(windows)} windows along the route; scores {min(scores):.3f} "
        f"to {max(scores):.3f}; {n_wrong} wrong, {n_refused} answered no match."
    )


def _stacked(whole: "Axes", shares: Sequence[float]) -> list["Axes"]:
    """Divide a panel into rows of these relative heights; the whole keeps only its outline."""
    whole.axis("off")
    box = whole.get_position()
    gap = 0.05 * box.height
    unit = (box.height - gap * (len(shares) - 1)) / sum(shares)
    rows, top = [], box.y1
    for share in shares:
        figure = whole.get_figure(root=True)
        assert figure is not None
        rows.append(figure.add_axes((box.x0, top - share * unit, box.width, share * unit)))
        top -= share * unit + gap
    return rows


def _score_row(axes: "Axes", record: ComparisonRecord, windows: Sequence[Window]) -> None:
    _marked(axes, windows, "score")
    threshold = record.provenance.threshold
    if threshold is not None:
        axes.axhline(threshold, color=COLOURS["ink"], lw=1.1, dashes=(5, 3))
    axes.set_ylabel("Score")
    axes.margins(y=0.12)
    axes.grid(axis="y")


def _margin_row(axes: "Axes", windows: Sequence[Window]) -> None:
    axes.axhline(0, color=COLOURS["ink"], lw=0.9)
    _marked(axes, windows, "margin")
    axes.set_ylabel("Margin")
    axes.margins(y=0.12)
    axes.grid(axis="y")


def _marked(axes: "Axes", windows: Sequence[Window], what: str) -> None:
    x = [window.query for window in windows]
    y = [getattr(window, what) for window in windows]
    crowded = len(windows) > MANY_POINTS
    if not crowded:
        axes.plot(x, y, color=COLOURS["grid"], lw=1.2, zorder=1)
    for verdict, style in _MARKS.items():
        chosen = [window for window in windows if window.verdict == verdict]
        axes.scatter(
            [window.query for window in chosen],
            [getattr(window, what) for window in chosen],
            rasterized=crowded,
            zorder=3 if verdict == "wrong" else 2,
            **style,
        )


def _length_row(axes: "Axes", windows: Sequence[Window]) -> None:
    x = [window.query for window in windows]
    y = [window.sequence_length for window in windows]
    crowded = len(windows) > MANY_POINTS
    axes.step(x, y, where="mid", color=COLOURS["muted"], lw=1.3, rasterized=crowded)
    axes.set_ylabel("K")
    axes.set_ylim(0, max(y) * 1.12)
    axes.grid(axis="y")
    _whole_numbers(axes, y=True)


def _unanswered(axes: "Axes", record: ComparisonRecord) -> None:
    """Hatch the query frames that start no window."""
    missing = np.setdiff1d(np.arange(record.matches.n_queries), record.matches.query)
    for run in np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1):
        if len(run):
            axes.axvspan(
                run[0] - 0.5,
                run[-1] + 0.5,
                facecolor="none",
                edgecolor=COLOURS["grid"],
                hatch="////",
                linewidth=0,
                zorder=0,
            )


def _whole_numbers(axes: "Axes", *, x: bool = False, y: bool = False) -> None:
    from matplotlib.ticker import MaxNLocator

    for axis, wanted in ((axes.xaxis, x), (axes.yaxis, y)):
        if wanted:
            axis.set_major_locator(MaxNLocator(nbins=6, integer=True, min_n_ticks=1))
