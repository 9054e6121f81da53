"""A lean drawing beside matplotlib's own: Chromium shows the same picture."""

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from tests.unit.reports.records import make_record, pictures
from tests.unit.reports.test_lean_svg import drawn

from retraverse.reports import svg, write_comparison_report
from retraverse.reports.lean_svg import lean_svg
from retraverse.types import ImageArray

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

MOST_CHANGED = 0.01
"""Share of pixels that may differ clearly: rounded places smooth edges otherwise."""
CLEARLY = 96


def draw_comparison(folder: Path) -> None:
    record = make_record(notes=("A note.",))
    write_comparison_report(
        record,
        folder / "report.html",
        reference=pictures(record.reference.n_frames),
        query=pictures(record.query.n_frames),
    )


def draw_lines(_: Path) -> None:
    values = np.random.default_rng(2).uniform(0, 100, (5, 40))
    drawn([[*row] for row in values])
    drawn([[20.0, 150.0, -40.0, 60.0]])


@pytest.mark.parametrize(("draw", "least"), [(draw_comparison, 4), (draw_lines, 2)])
def test_nothing_that_is_seen_is_lost(
    browser: "Browser",
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    draw: Callable[[Path], None],
    least: int,
) -> None:
    pairs: list[tuple[str, str]] = []

    def remembered(text: str, alt: str) -> str:
        pairs.append((text, lean_svg(text, alt)))
        return pairs[-1][1]

    monkeypatch.setattr(svg, "lean_svg", remembered)
    draw(tmp_path)
    assert len(pairs) >= least
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    context.set_default_timeout(120_000)
    page = context.new_page()
    for original, lean in pairs:
        expected, got = (seen(page, text) for text in (original, lean))
        changed = np.abs(expected.astype(int) - got).max(axis=2) > CLEARLY
        assert changed.mean() <= MOST_CHANGED, lean[:300]
        assert (expected < 128).mean() > 0.001, "something was drawn"
    context.close()


def seen(page: "Page", text: str) -> ImageArray:
    """Return a drawing as the browser shows it, one pixel a unit."""
    drawing = text[text.index("<svg") :]
    width, height = re.findall(r"[\d.]+", drawing.partition('viewBox="')[2].partition('"')[0])[2:]
    sizes = f"<style>body{{margin:0}}svg{{width:{width}px;height:{height}px;display:block}}</style>"
    page.set_content(f"<!doctype html>{sizes}<body>{drawing}</body>")
    return np.asarray(Image.open(io.BytesIO(page.locator("svg").screenshot())).convert("RGB"))
