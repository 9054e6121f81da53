"""The comparison report as a reader meets it: opened from disk in a browser."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.unit.reports.records import HOSTILE, make_record, pictures

from retraverse.reports import write_comparison_report
from retraverse.studies.comparison_record import ComparisonRecord

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

WIDTHS = (400, 820, 1600)


@dataclass
class Opened:
    """A page in the browser, and everything it complained about or asked for."""

    page: "Page"
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


def written(record: ComparisonRecord, folder: Path) -> Path:
    return write_comparison_report(
        record,
        folder / "report.html",
        reference=pictures(record.reference.n_frames),
        query=pictures(record.query.n_frames),
    )


@pytest.fixture(scope="module", name="judged")
def _judged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(make_record(notes=("A note.",)), tmp_path_factory.mktemp("judged"))


@pytest.fixture(scope="module", name="blind")
def _blind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(make_record(tolerance=None), tmp_path_factory.mktemp("blind"))


@pytest.fixture(name="open_report")
def _open_report(browser: "Browser") -> "Iterator[Opener]":
    contexts = []

    def open_report(path: Path, width: int, **settings: Any) -> Opened:
        context = browser.new_context(viewport={"width": width, "height": 900}, **settings)
        context.set_default_timeout(120_000)
        contexts.append(context)
        opened = Opened(context.new_page())
        page = opened.page
        page.on("console", lambda message: opened.complaints.append(message.text))
        page.on("pageerror", lambda error: opened.complaints.append(str(error)))
        page.on("request", lambda request: opened.requests.append(request.url))
        page.goto(path.as_uri())
        return opened

    yield open_report
    for context in contexts:
        context.close()


Opener = Callable[..., Opened]


def is_quiet(opened: Opened) -> bool:
    outside = [url for url in opened.requests if not url.startswith(("file:", "data:"))]
    assert opened.complaints == []
    assert outside == []
    assert sum(url.startswith("file:") for url in opened.requests) == 1
    return True


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", ["judged", "blind"])
def test_page_is_quiet_and_fits(
    open_report: Opener, width: int, kind: str, request: pytest.FixtureRequest
) -> None:
    opened = open_report(request.getfixturevalue(kind), width)
    assert is_quiet(opened)
    widest = opened.page.evaluate("document.documentElement.scrollWidth")
    assert widest <= width
    broken = opened.page.evaluate(
        "[...document.images].filter((image) => !image.naturalWidth).length"
    )
    assert broken == 0
    assert opened.page.locator("img:not([alt]), img[alt='']").count() == 0


@pytest.mark.parametrize("width", WIDTHS)
def test_text_in_figures_stays_readable(open_report: Opener, judged: Path, width: int) -> None:
    page = open_report(judged, width).page
    heights = page.evaluate(
        """[...document.querySelectorAll('.plot svg text')]
        .filter((text) => text.checkVisibility())
        .map((text) => parseFloat(getComputedStyle(text).fontSize)
             * Math.hypot(text.getScreenCTM().a, text.getScreenCTM().b))"""
    )
    assert len(heights) > 20
    assert min(heights) > 8.5


def test_the_slider_walks_along_the_route(open_report: Opener, judged: Path) -> None:
    opened = open_report(judged, 1600)
    page = opened.page
    picture = page.locator("#walk .picture.query img")
    middle = picture.get_attribute("src")
    slider = page.locator("[data-walk=slider]")
    slider.focus()
    slider.press("Home")
    assert picture.get_attribute("src") != middle
    assert picture.get_attribute("alt") == "Query frame 0, frame_0.jpg"
    page.locator("[data-walk=next]").click()
    assert picture.get_attribute("alt") == "Query frame 1, frame_1.jpg"
    page.locator("[data-walk=previous]").click()
    assert picture.get_attribute("alt") == "Query frame 0, frame_0.jpg"
    slider.press("End")
    wrong_or_right = page.locator("[data-walk=verdict]").inner_text()
    assert wrong_or_right.split(",")[0] in {"correct", "wrong"}
    page.wait_for_function("document.querySelector('#walk .query img').naturalWidth === 64")
    assert is_quiet(opened)


@pytest.mark.parametrize("width", [400, 1600])
def test_the_matrix_tells_the_pair_under_the_pointer(
    open_report: Opener, judged: Path, width: int
) -> None:
    page = open_report(judged, width).page
    query, reference = 10, 30
    cells = page.locator(".layer-scores")
    cells.scroll_into_view_if_needed()
    box = cells.bounding_box()
    assert box is not None
    x = box["x"] + (reference + 0.5) / 44 * box["width"]
    y = box["y"] + (query + 0.5) / 40 * box["height"]
    page.mouse.move(x, y)
    score = make_record().similarity[query, reference]
    expected = f"query {query}, reference {reference}: {score:.3f}"
    assert page.locator("[data-readout]").inner_text() == expected
    page.mouse.click(x, y)
    alt = page.locator("#walk .picture.query img").get_attribute("alt")
    assert alt == f"Query frame {query}, frame_{query}.jpg"


def test_layers_can_be_hidden(open_report: Opener, judged: Path) -> None:
    page = open_report(judged, 1600).page
    for layer in ("matches", "truth"):
        drawn = page.locator(f".layer-{layer}").first
        assert drawn.is_visible()
        page.locator(f"[data-layer={layer}]").uncheck()
        assert not drawn.is_visible()


def test_a_row_of_pictures_can_be_enlarged(open_report: Opener, judged: Path) -> None:
    opened = open_report(judged, 1600)
    page = opened.page
    page.locator(".enlarge").first.click()
    dialog = page.locator("dialog")
    assert dialog.is_visible()
    assert dialog.locator("img").count() == 3
    page.keyboard.press("Escape")
    assert not dialog.is_visible()
    page.locator(".case .trio").first.click()
    assert dialog.is_visible()
    assert is_quiet(opened)


def test_hostile_names_do_nothing(open_report: Opener, tmp_path: Path) -> None:
    record = make_record(name="{}" + HOSTILE, notes=(HOSTILE,))
    record = replace(
        record,
        query=replace(record.query, name=HOSTILE, source=HOSTILE),
        provenance=replace(record.provenance, command=HOSTILE, parameters={HOSTILE: HOSTILE}),
    )
    opened = open_report(written(record, tmp_path), 400)
    page = opened.page
    page.locator("[data-walk=slider]").press("Home")
    page.locator(".case .trio").first.click()
    assert page.evaluate("window.hacked") is None
    alt = page.locator("#walk .picture.query img").get_attribute("alt")
    assert alt == f"Query frame 0, 0{HOSTILE}"
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert is_quiet(opened)


@pytest.mark.parametrize(
    "record",
    [
        make_record(1, 30, lengths=[1]),
        make_record(4, 30, lengths=[9] * 4),
        make_record(20, 30, lengths=[1] * 20, threshold=2.0),
    ],
    ids=["one-query", "no-window", "all-refused"],
)
def test_extremes_are_quiet(open_report: Opener, tmp_path: Path, record: ComparisonRecord) -> None:
    assert is_quiet(open_report(written(record, tmp_path), 1600))


def test_without_script_the_page_is_whole(open_report: Opener, judged: Path) -> None:
    opened = open_report(judged, 1600, java_script_enabled=False)
    page = opened.page
    assert not page.locator("[data-walk=slider]").is_visible()
    assert not page.locator(".enlarge").first.is_visible()
    assert page.locator("#walk .picture.query img").is_visible()
    assert page.locator(".plot svg").first.is_visible()


def test_dark_and_print_colours(open_report: Opener, judged: Path) -> None:
    page = open_report(judged, 1600, color_scheme="dark").page
    script = r"getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number)"
    assert max(page.evaluate(script)) < 60
    page.emulate_media(media="print")
    assert min(page.evaluate(script)) > 200
    assert not page.locator("[data-walk=slider]").is_visible()
