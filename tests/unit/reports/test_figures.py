"""Every figure: well-formed, named, the same each time, and true to its numbers."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from tests.unit.reports.records import make_record

from retraverse.reports.curve_figures import (
    accuracy_by_length,
    length_histogram,
    precision_recall,
    route_figure,
)
from retraverse.reports.matrix_figure import matrix_figure
from retraverse.reports.svg import COLOURS, Plot
from retraverse.reports.windows import windows_of
from retraverse.studies.comparison_record import ComparisonRecord

Drawing = Callable[[ComparisonRecord], Plot | None]

FIGURES: dict[str, Drawing] = {
    "matrix": lambda record: matrix_figure(record, windows_of(record)).plot,
    "precision-recall": precision_recall,
    "histogram": length_histogram,
    "by-length": accuracy_by_length,
    "route-wide": lambda record: route_figure(record, windows_of(record), wide=True),
    "route-narrow": lambda record: route_figure(record, windows_of(record), wide=False),
}


@pytest.fixture(params=FIGURES, name="draw")
def _draw(request: pytest.FixtureRequest) -> Drawing:
    return FIGURES[request.param]


def drawn(draw: Drawing, record: ComparisonRecord) -> Plot:
    plot = draw(record)
    assert plot is not None
    return plot


def test_svg_is_well_formed_and_named(draw: Drawing) -> None:
    plot = drawn(draw, make_record())
    root = ET.fromstring(plot.svg)
    assert root.get("role") == "img"
    assert root.get("aria-label") == plot.alt
    assert len(plot.alt) > 20
    assert not root.findall(".//{http://www.w3.org/2000/svg}metadata")


def test_ids_are_only_those_in_use(draw: Drawing) -> None:
    svg = str(drawn(draw, make_record()).svg)
    ids = re.findall(r' id="([^"]+)"', svg)
    assert len(ids) == len(set(ids))
    assert set(ids) <= set(re.findall(r'(?:url\(#|href="#)([^")]+)', svg))


def test_colours_follow_the_page(draw: Drawing) -> None:
    svg = str(drawn(draw, make_record()).svg)
    assert "var(--ink)" in svg
    assert not [value for value in COLOURS.values() if value in svg]


def test_the_same_record_gives_the_same_bytes(draw: Drawing) -> None:
    assert drawn(draw, make_record()).svg == drawn(draw, make_record()).svg


def test_settings_of_matplotlib_stay_as_they_were(draw: Drawing) -> None:
    with matplotlib.rc_context({"font.size": 31.0, "axes.facecolor": "pink"}):
        before = dict(matplotlib.rcParams)
        in_pink = drawn(draw, make_record()).svg
        assert dict(matplotlib.rcParams) == before
    assert in_pink == drawn(draw, make_record()).svg


def test_without_truth_only_what_can_be_known_is_drawn() -> None:
    record = make_record(tolerance=None)
    assert precision_recall(record) is None
    assert accuracy_by_length(record) is None
    assert length_histogram(record) is not None
    assert "layer-truth" not in drawn(FIGURES["matrix"], record).svg


def test_a_fixed_length_needs_no_histogram() -> None:
    assert length_histogram(make_record(lengths=[3] * 40)) is None


@pytest.mark.parametrize("wide", [True, False])
def test_span_of_the_route_is_the_query_traverse(wide: bool) -> None:
    record = make_record()
    span = route_figure(record, windows_of(record), wide=wide).span
    assert span.x == (-0.5, 39.5)
    assert 0 < span.left < span.left + span.width < 1
    assert 0 < span.top < span.top + span.height < 1


def test_matrix_rows_are_queries_downwards() -> None:
    record = make_record(40, 44)
    span = drawn(FIGURES["matrix"], record).span
    assert span.x == (-0.5, 43.5)
    assert span.y == (-0.5, 39.5)


def test_large_matrices_are_averaged_in_blocks() -> None:
    record = make_record(600, 1100, lengths=[1] * 600, tolerance=None)
    figure = matrix_figure(record, windows_of(record))
    assert figure.block == (2, 3)
    assert len(figure.plot.svg) < 700_000


def test_a_flat_matrix_and_one_with_nan_are_drawn() -> None:
    record = make_record(12, 12, tolerance=None)
    flat = replace(record, similarity=np.full((12, 12), 0.5, np.float32))
    assert matrix_figure(flat, windows_of(flat)).low < 0.5
    nan = replace(record, similarity=np.full((12, 12), np.nan, np.float32))
    assert matrix_figure(nan, windows_of(nan)).high == 1.0


@pytest.mark.parametrize(("n_queries", "n_references"), [(1, 1), (1, 30), (30, 1), (2, 2)])
def test_the_smallest_records_are_drawn(draw: Drawing, n_queries: int, n_references: int) -> None:
    plot = draw(make_record(n_queries, n_references, lengths=[1] * n_queries))
    if plot is not None:
        ET.fromstring(plot.svg)
