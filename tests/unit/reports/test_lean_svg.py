"""Drawings in few bytes: nothing that is seen is lost, and a page has every mark once."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import pytest

from retraverse.reports.lean_svg import shared_marks
from retraverse.reports.study_report.artefacts import Line, Panel
from retraverse.reports.study_report.panels import draw_lines
from retraverse.reports.study_report.series import Series
from retraverse.reports.svg import Plot, drawing, export, panel, standalone

SVG = "{http://www.w3.org/2000/svg}"
MOST_OF_A_PANEL = 3200
"""Bytes of axes, ticks, labels and description."""
MOST_OF_A_LINE = 300
MOST_OF_A_POINT = 60


def drawn(
    lines: Sequence[Sequence[float]], *, y_limits: tuple[float, float] | None = (0, 103)
) -> Panel:
    made = [
        Line(
            Series(at, f"line {at}", f"technique {at}"),
            tuple(float(x) for x in range(1, len(y) + 1)),
            tuple(y),
            (None,) * len(y),
        )
        for at, y in enumerate(lines)
    ]
    return draw_lines("Title", "note", made, name="test", x_label="x, m", y_label="y, %",
                      y_limits=y_limits)  # fmt: skip


def svg_of(plot: Plot) -> ET.Element:
    return ET.fromstring(standalone(plot).partition("\n")[2])


def marks(plot: Plot) -> list[tuple[float, float]]:
    return [
        (float(use.get("x", "")), float(use.get("y", ""))) for use in svg_of(plot).iter(f"{SVG}use")
    ]


def test_every_point_has_its_mark_where_the_page_looks_for_it() -> None:
    values = [12.3456, 50.0, 99.9]
    plot = drawn([values, values[::-1]]).plot
    span = plot.span
    wanted = [
        (
            400 * (span.left + span.width * (x - span.x[0]) / (span.x[1] - span.x[0])),
            280 * (span.top + span.height * (y - span.y[0]) / (span.y[1] - span.y[0])),
        )
        for line in (values, values[::-1])
        for x, y in enumerate(line, 1)
    ]
    for (x, y), (mark_x, mark_y) in zip(wanted, marks(plot), strict=True):
        assert mark_x == pytest.approx(x, abs=0.051)
        assert mark_y == pytest.approx(y, abs=0.051)


@pytest.mark.parametrize(("n_lines", "n_points"), [(1, 2), (3, 10), (12, 20)])
def test_a_drawing_takes_few_bytes_for_each_point(n_lines: int, n_points: int) -> None:
    lines = [[(37 * at + 11.7 * x) % 97 for x in range(n_points)] for at in range(n_lines)]
    n_bytes = len(drawn(lines).plot.svg.encode())
    assert n_bytes < MOST_OF_A_PANEL + n_lines * (MOST_OF_A_LINE + MOST_OF_A_POINT * n_points)


def test_places_have_one_decimal_and_shapes_two() -> None:
    text = re.sub(r'aria-label="[^"]*"', "", drawn([[1.23456, 7.65432], [3.3, 4.4]]).plot.svg)
    shapes = "".join(re.findall(r"<defs>.*?</defs>", text))
    assert not re.search(r"\d\.\d\d\d", shapes)
    assert not re.search(r"\d\.\d\d", re.sub(r"<defs>.*?</defs>", "", text))


def test_layers_stay_to_be_hidden_by_technique() -> None:
    text = str(drawn([[1, 2, 3], [3, 2, 1]]).plot.svg)
    for at in (0, 1):
        assert f'class="layer-technique-{at}"' in text


def test_what_leaves_the_panel_is_cut_and_nothing_else() -> None:
    assert "clip-path" not in drawn([[10, 90, 40]]).plot.svg
    cut = str(drawn([[10, 190, 40]]).plot.svg)
    (clip,) = re.findall(r'<clipPath id="([^"]+)"><rect', cut)
    assert cut.count(f'clip-path="url(#{clip})"') >= 1


def test_a_picture_is_cut_where_it_is_and_not_where_it_is_moved_from() -> None:
    with drawing("picture"):
        figure, axes = panel(200, 150)
        axes.imshow([[0, 1], [1, 0]])
        svg = svg_of(export(figure, axes, "two by two"))
    (picture,) = svg.iter(f"{SVG}image")
    assert picture.get("transform")
    assert not any(one.get("transform") and one.get("clip-path") for one in svg.iter())


@pytest.mark.filterwarnings("ignore:Glyph 7")
def test_text_is_only_text() -> None:
    with drawing("hostile"):
        figure, axes = panel(400, 280)
        axes.set_xlabel('<b>"&$x\x07')
        plot = export(figure, axes, 'says "<&"')
    assert ET.fromstring(str(plot.svg)).get("aria-label") == 'says "<&"'
    assert [
        text.text for text in svg_of(plot).iter(f"{SVG}text") if "<b>" in (text.text or "")
    ] == ['<b>"&$x']


def test_a_page_has_every_shape_once() -> None:
    one, other = drawn([[1, 2], [2, 1]]).plot, drawn([[5, 6], [6, 5]]).plot
    page = f"<p>{one.svg}</p><p>{other.svg}</p>"
    shared = shared_marks(page)
    ids = re.findall(r'<path id="([^"]+)"', shared)
    assert len(ids) == 2
    assert set(re.findall(r'href="#([^"]+)"', shared)) == set(ids)
    assert shared.count("<use") == page.count("<use") == 8
    assert shared_marks(shared) == shared


def test_a_drawing_of_its_own_is_read_by_older_programs_too() -> None:
    text = standalone(drawn([[1, 2]]).plot)
    assert 'xmlns:xlink="http://www.w3.org/1999/xlink"' in text
    assert '<use xlink:href="#' in text
    assert "var(" not in text
