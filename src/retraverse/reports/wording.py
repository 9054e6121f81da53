"""Numbers and sentences as a reader wants them: units, rounding, plural."""

import math
import re

from markupsafe import Markup, escape

from retraverse.studies.comparison_record import ComparisonRecord

__all__ = [
    "bytes_text",
    "count",
    "headline",
    "length_text",
    "percent",
    "plain",
    "points",
    "ratio",
    "seconds",
    "signed",
    "subscripts",
    "tolerance",
]

NARROW = "\u202f"
"""Narrow no-break space, between a number and its unit."""
NOTHING = "–"
"""Where there is no such number."""


def percent(value: float | None) -> str:
    """Return a share in [0, 1] as per cent with one decimal: 0.96 -> "96.0 %"."""
    return NOTHING if value is None or math.isnan(value) else f"{100 * value:.1f}{NARROW}%"


def ratio(value: float | None) -> str:
    """Return a number with three decimals: 0.8123 -> "0.812"."""
    return NOTHING if value is None or math.isnan(value) else f"{value:.3f}"


def signed(value: float) -> str:
    """Return a number with two decimals and a true minus sign: -0.1 -> "−0.10"."""
    return f"{value:.2f}".replace("-", "−")


def points(value: float) -> str:
    """Return a difference of shares in percentage points with its sign: -3.21 -> "−3.2"."""
    if math.isnan(value):
        return NOTHING
    # Adding 0 makes a rounded -0 a plain one.
    return f"{round(value, 1) + 0.0:+.1f}".replace("-", "−")


def subscripts(text: str) -> Markup:
    """Return text for a page with the field's indices set as such: "t_VPR", "R_P100"."""
    return Markup(re.sub(r"\b([tPRK])_([A-Za-z0-9]+)\b", r"\1<sub>\2</sub>", str(escape(text))))


def plain(value: float | None) -> str:
    """Return a number with at most two decimals and none it does not need: 6.50 -> "6.5"."""
    if value is None or math.isnan(value):
        return NOTHING
    return f"{value:.2f}".rstrip("0").rstrip(".")


def seconds(value: float | None) -> str:
    """Return a time in the unit that reads best, three figures: 0.0123 -> "12.3 ms"."""
    if value is None or math.isnan(value):
        return NOTHING
    unit, scaled = "s", value
    for smaller in ("ms", "µs"):
        if scaled < 1:
            unit, scaled = smaller, scaled * 1e3
    decimals = max(0, 2 - int(math.log10(max(scaled, 1))))
    return f"{scaled:,.{decimals}f}{NARROW}{unit}"


def bytes_text(value: int) -> str:
    """Return a size in decimal units: 123008 -> "123 kB"."""
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if value >= factor:
            return f"{value / factor:.3g}{NARROW}{unit}"
    return f"{value}{NARROW}bytes"


def count(n: int, word: str, plural: str = "") -> str:
    """Return "1 frame", "2 frames", "1,024 frames"."""
    return f"{n:,} {word if n == 1 else plural or word + 's'}"


def tolerance(record: ComparisonRecord) -> str:
    """Return how near an answer must be: "within ±2 frames", or the truth's own words."""
    if record.truth is None:
        return ""
    frames = record.truth.tolerance_frames
    if frames is None:
        return f"({record.truth.description})"
    return f"within ±{count(frames, 'frame')}" if frames else "to the frame"


def headline(record: ComparisonRecord) -> str:
    """Return the result in one sentence."""
    n_located = int((record.matches.reference >= 0).sum())
    located = f"{n_located:,} of {count(record.matches.n_queries, 'query frame')} located"
    if record.evaluation is None:
        return f"{located} on a map of {count(record.matches.n_references, 'frame')}"
    return f"{located}; {percent(record.evaluation.accuracy)} correct {tolerance(record)}".strip()


def length_text(record: ComparisonRecord) -> str:
    """Return the sequence length in words: "K = 10", "dynamic K, 2 to 15"."""
    lengths = record.matches.sequence_length
    asked = record.provenance.sequence_length
    if not len(lengths):
        return f"K = {asked}" if asked.isdigit() else f"{asked} K"
    shortest, longest = int(lengths.min()), int(lengths.max())
    if shortest == longest:
        return f"K = {shortest}" if asked.isdigit() else f"{asked} K, always {shortest}"
    if asked.isdigit():
        return f"K = {asked}, {shortest} to {longest} frames of evidence"
    return f"{asked} K, {shortest} to {longest}"
