"""A study's report as a reader meets it: sort, filter, open a run, step through its matches."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.unit.reports.study_report.made_up import (
    MATRIX,
    ROUTES,
    MadeUpDrives,
    chapter_runs,
    make_run,
    write_study,
)

from retraverse.reports import write_study_report
from retraverse.reports.study_report.serve import StudyServer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

WIDTHS = (400, 1600)
PAGES = ("index", "chapter-4", "chapter-6")


@dataclass
class Opened:
    """A page in the browser, and everything it complained about or asked for."""

    page: "Page"
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def is_quiet(self, scheme: str = "file:") -> bool:
        assert self.complaints == []
        assert [url for url in self.requests if not url.startswith((scheme, "data:"))] == []
        return True


@pytest.fixture(scope="module", name="report")
def _report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    runs = [run for chapter in ("4", "6") for run in chapter_runs(chapter, matrix=MATRIX)]
    write_study(folder, [run for run in runs if run.dataset == "campus_loop" or run.chapter == "4"])
    drives = {"corridor": MadeUpDrives(ROUTES["corridor"])}
    return write_study_report(folder, folder / "report", pictures=drives.get).parent


@pytest.fixture(name="open_page")
def _open_page(browser: "Browser") -> "Iterator[Opener]":
    contexts = []

    def open_page(address: str, width: int = 1600, **settings: Any) -> Opened:
        context = browser.new_context(viewport={"width": width, "height": 900}, **settings)
        context.set_default_timeout(120_000)
        contexts.append(context)
        opened = Opened(context.new_page())
        page = opened.page
        page.on("console", lambda message: opened.complaints.append(message.text))
        page.on("pageerror", lambda error: opened.complaints.append(str(error)))
        page.on("request", lambda request: opened.requests.append(request.url))
        page.goto(address)
        return opened

    yield open_page
    for context in contexts:
        context.close()


Opener = Callable[..., Opened]


def column(table: "Locator", at: int) -> list[str]:
    rows = table.locator("tbody tr:not(.absent-row)").all()
    return [row.locator("th, td").nth(at).inner_text().split()[0] for row in rows]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", PAGES)
def test_pages_are_quiet_and_fit(open_page: Opener, report: Path, name: str, width: int) -> None:
    opened = open_page((report / f"{name}.html").as_uri(), width)
    page = opened.page
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    heights = page.evaluate(
        """[...document.querySelectorAll('.plot svg text')]
        .filter((text) => text.checkVisibility())
        .map((text) => parseFloat(getComputedStyle(text).fontSize)
             * Math.hypot(text.getScreenCTM().a, text.getScreenCTM().b))"""
    )
    assert min(heights, default=99) > 8.5
    assert page.locator("svg[role=img]:not([aria-label])").count() == 0
    assert opened.is_quiet()
    # The page itself and the pictures of its sheets; nothing of a run before it is opened.
    others = [url for url in opened.requests if "/report/pictures/" not in url]
    assert others == [(report / f"{name}.html").as_uri()]


def test_a_page_begins_with_what_was_found(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    found = page.locator(".findings")
    assert "100 % comes first with" in found.inner_text()
    first_figure = page.locator("main section").first
    above, below = found.bounding_box(), first_figure.bounding_box()
    assert above is not None
    assert below is not None
    assert above["y"] < below["y"]
    found.locator("a", has_text="Accuracy rises").click()
    page.locator("#accuracy-rises .claim").wait_for()
    assert page.url.endswith("index.html#accuracy-rises")
    assert opened.is_quiet()


@pytest.mark.parametrize("width", WIDTHS)
def test_a_choice_opens_its_run(open_page: Opener, report: Path, width: int) -> None:
    opened = open_page((report / "index.html").as_uri(), width)
    page = opened.page
    table = page.locator("table.stacks")
    row = table.locator("tbody tr").first
    technique = row.locator(".open-run").inner_text()
    row.locator(".open-run").click()
    dialog = page.locator("#run")
    dialog.locator("h2", has_text=technique.split(",")[0]).wait_for()
    shown = dialog.locator(".figure-value").first.inner_text().split()[0]
    assert shown in row.text_content()  # type: ignore[operator]
    page.keyboard.press("Escape")
    if width > 1000:
        table.locator("th", has_text="Bytes of a window").locator("button").click()
        heading = table.locator("th", has_text="Bytes of a window")
        assert heading.get_attribute("aria-sort") == "ascending"
    assert opened.is_quiet()


def test_tables_sort_by_click_and_by_keyboard(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    table = page.locator("table.sortable").first
    heading = table.locator("th", has_text="Accuracy at K = 1")
    button = heading.locator("button")
    button.click()
    assert heading.get_attribute("aria-sort") == "ascending"
    rising = [float(value) for value in column(table, 2)]
    assert rising == sorted(rising)
    button.press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    assert [float(value) for value in column(table, 2)] == sorted(rising, reverse=True)
    other = table.locator("th", has_text="Technique").locator("button")
    other.focus()
    page.keyboard.press("Space")
    assert heading.get_attribute("aria-sort") is None
    assert column(table, 0) == sorted(column(table, 0))
    last = table.locator("tbody tr").last
    assert "dataset not here" in last.inner_text()
    assert opened.is_quiet()


def test_techniques_can_be_left_out(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    rows = page.locator("tr[data-technique=hog]")
    layer = page.locator(".panel svg .layer-hog").first
    assert rows.first.is_visible()
    assert layer.is_visible()
    page.locator("[data-filter=hog]").uncheck()
    assert not rows.first.is_visible()
    assert not layer.is_visible()
    assert page.locator("tr[data-technique=cohog]").first.is_visible()
    page.get_by_role("button", name="none", exact=True).click()
    assert not page.locator("tr[data-technique=cohog]").first.is_visible()
    page.get_by_role("button", name="all", exact=True).click()
    assert rows.first.is_visible()
    assert layer.is_visible()
    assert opened.is_quiet()


def test_a_click_on_a_row_opens_its_run(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    row = page.locator("tr[data-technique=cohog]", has_text="Corridor").first
    row.locator("td").nth(3).click()
    dialog = page.locator("#run")
    dialog.locator("h2", has_text="cohog on Corridor").wait_for()
    assert "cell_size 16" in dialog.locator(".settings").text_content()  # type: ignore[operator]
    assert dialog.locator(".run-plot img").evaluate("image => image.decode().then(() => true)")
    assert dialog.get_by_text("Windows answered correctly").count() == 1
    page.keyboard.press("Escape")
    assert not dialog.is_visible()
    assert opened.is_quiet()


def test_a_value_says_which_run_it_opens(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-6.html").as_uri())
    button = opened.page.locator("table.sortable .open-run").first
    assert button.get_attribute("title") is None
    button.hover()
    title = button.get_attribute("title") or ""
    assert title.startswith("Open the run: cohog on Campus Loop, K = ")
    assert title.endswith("256 px")
    other = opened.page.locator("table.sortable .open-run").nth(1)
    other.focus()
    assert (other.get_attribute("title") or "").startswith("Open the run: ")
    assert opened.is_quiet()


def test_a_click_on_a_point_opens_its_run(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    plot = page.locator(".plot.points").first
    plot.scroll_into_view_if_needed()
    box, span = plot.bounding_box(), plot.evaluate("plot => JSON.parse(plot.dataset.span)")
    assert box is not None
    run = next(
        r
        for r in chapter_runs("4")
        if (r.technique, r.dataset, r.sequence_length) == ("hog", "corridor", "5")
    )
    x = span["left"] + span["width"] * (5 - span["x"][0]) / (span["x"][1] - span["x"][0])
    low, high = span["y"]
    y = span["top"] + span["height"] * (100 * run.accuracy - low) / (high - low)
    place = box["x"] + x * box["width"], box["y"] + y * box["height"]
    page.mouse.move(*place)
    readout = page.locator(".panel output").first.inner_text()
    assert readout == f"hog: Sequence length K 5 frames, Accuracy {100 * run.accuracy:.4g} %"
    page.mouse.click(*place)
    dialog = page.locator("#run")
    dialog.locator("h2", has_text="hog on Corridor").wait_for()
    assert dialog.locator("[data-run-slot=lengths]").input_value() == "5"
    assert f"{100 * run.accuracy:.1f}" in dialog.locator(".figure-value").first.inner_text()
    assert opened.is_quiet()


def test_points_are_reached_by_keyboard(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri())
    page = opened.page
    plot = page.locator(".plot.points").first
    plot.focus()
    readout = page.locator(".panel output").first
    page.keyboard.press("ArrowRight")
    assert readout.inner_text().startswith("cohog: Sequence length K 1")
    page.keyboard.press("ArrowRight")
    assert readout.inner_text().startswith("cohog: Sequence length K 2")
    page.keyboard.press("ArrowDown")
    assert readout.inner_text().startswith("hog: Sequence length K 2")
    page.keyboard.press("Enter")
    page.locator("#run h2", has_text="hog on Corridor").wait_for()
    assert opened.is_quiet()


def test_matches_are_stepped_through_by_mouse_and_keyboard(open_page: Opener, report: Path) -> None:
    opened = open_page((report / "chapter-4.html").as_uri(), 400)
    page = opened.page
    page.locator(".plot.points").first.focus()
    for key in ("ArrowRight", "Enter"):  # cohog at K = 1, which has wrong answers
        page.keyboard.press(key)
    dialog = page.locator("#run")
    picture = dialog.locator(".picture.query img")
    picture.wait_for()
    assert picture.get_attribute("alt") == "Query frame 0, query_0.png"
    assert dialog.locator(".trio img").count() == 3
    dialog.locator("[data-walk=next]").click()
    second = picture.get_attribute("alt")
    assert second != "Query frame 0, query_0.png"
    dialog.locator("h2").focus()
    page.keyboard.press("ArrowRight")
    assert picture.get_attribute("alt") not in (second, "Query frame 0, query_0.png")
    page.keyboard.press("ArrowLeft")
    assert picture.get_attribute("alt") == second
    dialog.locator("[data-walk=slider]").press("Home")
    assert picture.get_attribute("alt") == "Query frame 0, query_0.png"
    dialog.locator("[data-run-slot=which]").select_option("wrong")
    assert dialog.locator("[data-walk=verdict]").inner_text().startswith("wrong")
    dialog.locator("[data-run-slot=which]").select_option("all")
    plot = dialog.locator(".run-plot")
    box = plot.bounding_box()
    assert box is not None
    plot.click(position={"x": 5, "y": box["height"] * 30.5 / 60})
    assert dialog.locator("[data-walk=facts]").inner_text().startswith("query 30 ")
    broken = "[...document.images].filter((image) => image.src && !image.naturalWidth).length"
    page.wait_for_function(f"({broken}) === 0")
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert dialog.evaluate("dialog => dialog.scrollWidth <= dialog.clientWidth")
    assert opened.is_quiet()


def test_a_run_whose_file_is_gone_says_so(open_page: Opener, tmp_path: Path) -> None:
    write_study(tmp_path, [make_run(chapter="4")])
    out = write_study_report(tmp_path, tmp_path / "out").parent
    for path in (out / "runs").glob("*.js"):
        path.unlink()
    page = open_page((out / "chapter-4.html").as_uri()).page
    page.locator(".open-run").first.click()
    page.get_by_text("This run's file is not beside the page").wait_for()


def test_without_script_the_page_is_whole(open_page: Opener, report: Path) -> None:
    page = open_page((report / "chapter-4.html").as_uri(), java_script_enabled=False).page
    assert page.locator(".plot svg").first.is_visible()
    assert page.locator("table.sortable td").first.is_visible()
    assert not page.locator(".filter").is_visible()


def test_a_served_page_says_that_there_are_new_records(open_page: Opener, tmp_path: Path) -> None:
    study, folder = write_study(tmp_path / "study", [make_run(chapter="4")]), tmp_path / "pages"
    server = StudyServer(study, folder, lambda: write_study_report(study, folder))
    thread = threading.Thread(target=server.serve)
    thread.start()
    try:
        opened = open_page(server.address)
        page = opened.page
        assert page.locator("h1").inner_text().startswith("1 run:")
        news = page.locator("#news")
        assert not news.is_visible()
        write_study(study, [make_run("campus_loop", chapter="4")], part="later")
        news.wait_for()
        news.get_by_role("button").click()
        page.locator("h1", has_text="2 runs:").wait_for()
        page.locator("nav a", has_text="4.").click()
        page.locator(".open-run").first.click()
        page.locator("#run h2", has_text="hog on").wait_for()
        assert opened.is_quiet(server.address)
    finally:
        server.close()
        thread.join(30)
