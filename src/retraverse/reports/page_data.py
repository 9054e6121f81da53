"""What the page shows of single windows: sheets of matches, the walk, the script's data."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from retraverse.reports.pictures import Picture, PictureBook
from retraverse.reports.windows import Window, evenly, spread
from retraverse.reports.wording import count
from retraverse.studies.comparison_record import ComparisonRecord
from retraverse.types import Progress

__all__ = [
    "Sheet",
    "Step",
    "facts_text",
    "is_wide",
    "script_data",
    "sheets_of",
    "verdict_text",
    "walk_of",
]

_PICTURE_BYTES = 2_000_000
"""What all pictures together may take in the page."""
_MAX_STEPS = 60
"""Windows that the walk along the route shows at most."""
_MAX_HOVER_CELLS = 65_536
"""Matrices of at most so many pairs carry their scores, to be read under the pointer."""
_MAX_NAME_CHARACTERS = 120_000


@dataclass(frozen=True)
class Step:
    """One window with its three pictures."""

    window: Window
    query: Picture
    matched: Picture | None
    true: Picture | None


@dataclass(frozen=True)
class Sheet:
    """A group of windows shown side by side."""

    key: str
    title: str
    text: str
    steps: tuple[Step, ...]


def sheets_of(
    record: ComparisonRecord, windows: Sequence[Window], book: PictureBook, progress: Progress
) -> list[Sheet]:
    """Return the groups of windows that are shown side by side; a group may be empty."""
    surest = sorted(windows, key=lambda window: (-window.score, window.query))
    apart = max(1, record.matches.n_queries // 40)

    def sheet(key: str, title: str, text: str, chosen: Sequence[Window], n: int) -> Sheet:
        shown = spread(chosen, n, apart=apart)
        steps = progress(shown, total=len(shown), label=f"pictures: {title.lower()}")
        return Sheet(key, title, text, tuple(_step(window, book) for window in steps))

    def of(verdict: str) -> list[Window]:
        return [window for window in surest if window.verdict == verdict]

    refused = sheet(
        "refused",
        "Answered “no match”",
        "Their best scores stayed below the threshold; the highest first.",
        of("refused"),
        4,
    )
    if record.truth is None:
        known = of("unknown")
        return [
            sheet("surest", "Surest matches", "The highest scores.", known, 6),
            sheet("doubtful", "Least sure matches", "The lowest scores.", known[::-1], 6),
            refused,
        ]
    correct = of("correct")
    return [
        sheet("wrong", "Wrong matches", "The surest first: these mislead most.", of("wrong"), 8),
        sheet("doubtful", "Correct, least sure", "The lowest scores.", correct[::-1], 4),
        sheet("surest", "Correct, surest", "The highest scores.", correct, 4),
        refused,
    ]


def _step(window: Window, book: PictureBook) -> Step:
    return Step(
        window,
        query=book.get("query", window.query),
        matched=book.get("reference", window.reference) if window.reference >= 0 else None,
        true=(
            book.get("reference", window.true_reference)
            if window.true_reference is not None
            else None
        ),
    )


def walk_of(windows: Sequence[Window], book: PictureBook, progress: Progress) -> list[Step]:
    """Return evenly spaced windows, as many as the page has room for."""
    if not windows:
        return []
    if not book.pictures:
        _step(windows[0], book)
    each = book.n_bytes / len(book.pictures)
    n_steps = int(min(_MAX_STEPS, max(0, _PICTURE_BYTES - book.n_bytes) / (3 * each)))
    chosen = evenly(windows, max(n_steps, 1))
    shown = progress(chosen, total=len(chosen), label="pictures along the route")
    return [_step(window, book) for window in shown]


def is_wide(book: PictureBook) -> bool:
    """Say whether the pictures are rather panoramas, to be stacked and not set side by side."""
    first = next(iter(book.pictures.values()), None)
    return first is not None and first.width > 1.9 * first.height


def script_data(
    record: ComparisonRecord,
    windows: Sequence[Window],
    walk: Sequence[Step],
    sheets: Sequence[Sheet],
    book: PictureBook,
) -> dict[str, Any]:
    """Return what the page's script needs: steps, pictures that no sheet holds, hover scores."""
    in_page = {
        picture.key
        for sheet in sheets
        for step in sheet.steps
        for picture in (step.query, step.matched, step.true)
        if picture is not None
    }
    names = (record.query.frame_names, record.reference.frame_names)
    has_room = sum(len(name) for side in names for name in side) <= _MAX_NAME_CHARACTERS
    return {
        "steps": [_step_data(step, record) for step in walk],
        "pictures": {key: book.pictures[key].uri for key in book.pictures if key not in in_page},
        "names": {"q": names[0], "r": names[1]} if has_room else None,
        "scores": _hover_scores(record),
    }


def _step_data(step: Step, record: ComparisonRecord) -> dict[str, Any]:
    window = step.window
    references = record.reference.frame_names
    return {
        "query": window.query,
        "verdict": window.verdict,
        "verdictText": verdict_text(window),
        "factsText": facts_text(window),
        "frames": {
            "query": _frame_data(step.query, window.query, record.query.frame_names),
            "matched": _frame_data(step.matched, window.reference, references),
            "true": _frame_data(step.true, window.true_reference, references),
        },
    }


def _frame_data(
    picture: Picture | None, number: int | None, names: Sequence[str]
) -> dict[str, Any] | None:
    if picture is None or number is None:
        return None
    return {"key": picture.key, "number": number, "name": names[number]}


def verdict_text(window: Window) -> str:
    """Return the verdict in words: "wrong, 38 frames off"."""
    if window.verdict == "wrong":
        if window.frames_off is None:
            return "wrong: this place is not in the map"
        return f"wrong, {count(window.frames_off, 'frame')} off"
    if window.verdict == "refused" and window.is_right is not None:
        return "no match, and rightly so" if window.is_right else "no match, though there is one"
    return {"correct": "correct", "refused": "no match", "unknown": "matched"}[window.verdict]


def facts_text(window: Window) -> str:
    """Return score, margin and length of a window in one line."""
    margin = "" if np.isnan(window.margin) else f" · margin {window.margin:.3f}"
    return f"score {window.score:.3f}{margin} · K = {window.sequence_length}".replace("-", "−")


def _hover_scores(record: ComparisonRecord) -> dict[str, Any] | None:
    """Return the matrix in steps of 1/65535 of its range, as base64; None if it is too large."""
    scores = record.similarity
    if not 0 < scores.size <= _MAX_HOVER_CELLS or not np.isfinite(scores).all():
        return None
    low, high = float(scores.min()), float(scores.max())
    steps = np.round((scores - low) / ((high - low) or 1.0) * 65535).astype("<u2")
    return {"low": low, "high": high, "values": base64.b64encode(steps.tobytes()).decode()}
