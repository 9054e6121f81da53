"""The mean of a figure's panels."""

from collections.abc import Sequence

from retraverse.reports.study_report.artefacts import Figure, Line
from retraverse.reports.study_report.figures.values import PERCENT
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Series

__all__ = ["weighted_means"]


def weighted_means(figure: Figure, *, number: str, title: str, caption: str, weigh: bool) -> Figure:
    """Return the mean of a figure's panels; `weigh` counts every query picture once.

    A point is drawn only where all of the panels that have the line have it.
    """
    lines: dict[Series, list[Line]] = {}
    for panel in figure.panels:
        for line in panel.lines:
            lines.setdefault(line.series, []).append(line)
    means = [_mean_line(series, of_series, weigh) for series, of_series in sorted(lines.items())]
    if len(figure.panels) < 2:
        return Figure(number, title, (), caption, figure.definitions)
    first = figure.panels[0]
    panel = draw_lines(
        f"Mean of {len(figure.panels)} datasets",
        "every picture counts once" if weigh else "every dataset counts once",
        means,
        name=f"{number} {title}",
        x_label=first.x_label,
        y_label=first.y_label,
        x_ticks=first.x_ticks,
        is_log=first.is_log,
        y_limits=PERCENT if "%" in first.y_label else None,
    )
    return Figure(number, title, (panel,), caption, figure.definitions)


def _mean_line(series: Series, lines: Sequence[Line], weigh: bool) -> Line:
    common = sorted(set.intersection(*(set(line.x) for line in lines)))
    means = []
    for x in common:
        at = [(line.y[line.x.index(x)], line.runs[line.x.index(x)]) for line in lines]
        weights = [run.n_queries if weigh and run else 1 for _, run in at]
        total = sum(weight * y for weight, (y, _) in zip(weights, at, strict=True))
        means.append(total / sum(weights))
    return Line(series, tuple(common), tuple(means), (None,) * len(common))
