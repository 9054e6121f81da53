"""The page as a file: complete, self-contained, safe, and there or not there."""

import base64
import itertools
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.reports.records import HOSTILE, make_record, pictures

from retraverse.errors import FrameReadError, InputError, ShapeError
from retraverse.metrics import DEFINITIONS
from retraverse.reports import write_comparison_report
from retraverse.reports.comparison_report import comparison_html
from retraverse.reports.wording import headline
from retraverse.studies.comparison_record import ComparisonRecord
from retraverse.types import ImageArray

VOID = {"meta", "link", "img", "input", "br", "path", "use", "image", "rect"}
ADDRESSES = {"src", "href", "xlink:href", "action", "poster", "srcset", "data"}


class Page(HTMLParser):
    """Reads a page strictly: every tag closed in order; collects what the tests ask about."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(attrs) == len(dict(attrs)), f"an attribute is repeated in <{tag}>"
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def text(self) -> str:
        shown = (data for tag, data in self.texts if tag not in {"script", "style"})
        return re.sub(r"\s+", " ", " ".join(shown))


def html_of(record: ComparisonRecord) -> str:
    return comparison_html(
        record,
        reference=pictures(record.reference.n_frames),
        query=pictures(record.query.n_frames),
    )


def page_of(record: ComparisonRecord) -> Page:
    return Page(html_of(record))


def data_of(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


@pytest.fixture(scope="module", name="judged")
def _judged() -> Page:
    return page_of(make_record(notes=("3 of 40 query frames got no answer.",)))


@pytest.fixture(scope="module", name="blind")
def _blind() -> Page:
    return page_of(make_record(tolerance=None))


@pytest.fixture(params=["judged", "blind"], name="page")
def _page(request: pytest.FixtureRequest) -> Page:
    page: Page = request.getfixturevalue(request.param)
    return page


def test_every_picture_and_figure_says_what_it_shows(page: Page) -> None:
    assert page.all("img")
    assert all(image.get("alt") for image in page.all("img"))
    assert page.all("svg")
    assert all(svg.get("role") == "img" and svg.get("aria-label") for svg in page.all("svg"))


def test_nothing_is_fetched(page: Page) -> None:
    addresses = [
        value
        for _, attributes in page.tags
        for name, value in attributes.items()
        if name in ADDRESSES and value is not None
    ]
    assert addresses
    assert [a for a in addresses if not a.startswith(("data:", "#"))] == []
    styles = " ".join(data for tag, data in page.texts if tag == "style")
    assert "@import" not in styles
    assert "url(" not in styles


def test_the_page_has_a_language_one_title_and_headings_in_order(page: Page) -> None:
    assert page.all("html") == [{"lang": "en"}]
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert levels.count(1) == 1
    assert all(deeper - level <= 1 for level, deeper in itertools.pairwise(levels))


def test_ids_are_unique_and_references_lead_somewhere(page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    labels = [a["aria-labelledby"] for _, a in page.tags if "aria-labelledby" in a]
    assert set(labels) <= set(ids)


def test_figures_are_numbered_from_one(page: Page) -> None:
    numbers = [int(n) for n in re.findall(r"Figure (\d+)\.", page.text)]
    assert numbers == list(range(1, len(numbers) + 1))


def test_headline_notes_command_and_provenance_are_on_the_page(judged: Page) -> None:
    record = make_record()
    provenance = record.provenance
    for text in (
        headline(record),
        "3 of 40 query frames got no answer.",
        provenance.command,
        provenance.machine,
        provenance.created_at,
        provenance.opencv,
        record.query.content_hash,
        "roi_entropy",
        "torn.jpg",
        "ends early",
        "64 × 48",
    ):
        assert re.sub(r"\s+", " ", text) in judged.text


def test_every_number_of_the_evaluation_stands_with_its_definition(judged: Page) -> None:
    shown = "".join(judged.text.split())
    missing = [
        key
        for key, definition in DEFINITIONS.items()
        if key not in {"mean_sequence_length", "truth"}
        and "".join(definition.replace("_", "").split()) not in shown
    ]
    assert missing == []


def test_without_truth_nothing_is_called_right_or_wrong(blind: Page) -> None:
    assert "No ground truth was given" in blind.text
    assert "Surest matches" in blind.text
    assert "Least sure matches" in blind.text
    for word in ("wrong", "correct", "Precision", "Accuracy", "True frame"):
        assert word not in blind.text


def test_hostile_names_stay_text() -> None:
    record = make_record(name="{}" + HOSTILE, notes=(HOSTILE,))
    record = replace(
        record,
        query=replace(record.query, name=HOSTILE, source=HOSTILE, skipped=((HOSTILE, HOSTILE),)),
        provenance=replace(
            record.provenance, command=HOSTILE, machine=HOSTILE, parameters={HOSTILE: HOSTILE}
        ),
    )
    html = html_of(record)
    page = Page(html)
    assert len(page.all("script")) == 2
    assert not [attributes for _, attributes in page.tags if "onerror" in attributes]
    assert HOSTILE in page.text
    names = data_of(html)["names"]
    assert names["q"][7] == f"7{HOSTILE}"


def test_every_true_frame_and_every_answer_has_its_picture() -> None:
    html = html_of(make_record())
    page = Page(html)
    data = data_of(html)
    held = {image.get("data-picture") for image in page.all("img")} | set(data["pictures"])
    frames = [frame for step in data["steps"] for frame in step["frames"].values() if frame]
    assert frames
    assert {frame["key"] for frame in frames} <= held


def test_unanswered_tail_and_refusals_are_shown() -> None:
    page = page_of(make_record(40, 44, lengths=[6] * 40, threshold=0.6))
    assert "unanswered" in page.text
    assert "Answered “no match”" in page.text
    assert "no match, though there is one" in page.text
    assert "threshold 0.600" in page.text


@pytest.mark.parametrize(
    "record",
    [
        make_record(1, 1, lengths=[1]),
        make_record(1, 30, lengths=[1]),
        make_record(1, 30, lengths=[1], tolerance=None),
        make_record(30, 1, lengths=[1] * 30),
        make_record(4, 30, lengths=[9] * 4),
        make_record(4, 30, lengths=[9] * 4, tolerance=None),
        make_record(20, 30, lengths=[1] * 20, threshold=2.0),
    ],
    ids=["1x1", "one-query", "one-query-blind", "one-reference", "none", "none-blind", "refused"],
)
def test_extremes_make_a_whole_page(record: ComparisonRecord) -> None:
    page = page_of(record)
    assert re.sub(r"\s+", " ", headline(record)) in page.text
    assert "nan" not in page.text.lower().split()


def test_no_wrong_match_is_said_in_words() -> None:
    assert "No answered window was wrong." in page_of(make_record(6, 6, tolerance=5)).text


def test_a_picture_that_is_gone_does_not_lose_the_page() -> None:
    class Gone:
        def colour(self) -> ImageArray:
            raise FrameReadError("gone.jpg: no such file")

    record = make_record()
    html = comparison_html(record, reference=[Gone()] * 44, query=pictures(40))
    assert "could not be read again" in Page(html).text


def test_nine_million_pairs_and_noisy_pictures_stay_under_three_megabytes(tmp_path: Path) -> None:
    record = make_record(3000, 3000, lengths=[1 + query % 3 for query in range(3000)])
    frames = pictures(3000, size=(240, 320), noisy=True)
    path = write_comparison_report(record, tmp_path / "r.html", reference=frames, query=frames)
    assert path.stat().st_size < 3_000_000


def test_the_same_record_gives_the_same_page() -> None:
    assert html_of(make_record()) == html_of(make_record())


def test_progress_sees_the_pictures() -> None:
    seen: list[tuple[str, int, int]] = []

    def progress(items: Any, *, total: int, label: str) -> Iterator[Any]:
        listed = list(items)
        seen.append((label, total, len(listed)))
        return iter(listed)

    record = make_record()
    comparison_html(record, reference=pictures(44), query=pictures(40), progress=progress)
    assert seen
    assert all(total == n and label.startswith("pictures") for label, total, n in seen)


def test_the_file_is_the_page_and_replaces_an_older_one(tmp_path: Path) -> None:
    record = make_record()
    path = tmp_path / "new" / "report.html"
    query, reference = pictures(40), pictures(44)
    assert write_comparison_report(record, path, reference=reference, query=query) == path
    path.write_text("older")
    write_comparison_report(record, str(path), reference=reference, query=query)
    assert path.read_text("utf-8") == html_of(record)
    assert [entry.name for entry in path.parent.iterdir()] == ["report.html"]


@pytest.mark.parametrize("fails", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_page_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "report.html"
    path.write_text("older")
    if fails == "fsync":
        monkeypatch.setattr("os.fsync", full)
    else:
        monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        write_comparison_report(make_record(), path, reference=pictures(44), query=pictures(40))
    assert path.read_text() == "older"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_other_traverses_than_the_records_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"reference traverse: got 43 frames, expected .* 44"):
        write_comparison_report(
            make_record(), tmp_path / "r.html", reference=pictures(43), query=pictures(40)
        )
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_report(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got a folder"):
        write_comparison_report(make_record(), tmp_path, reference=pictures(44), query=pictures(40))


def test_scores_under_the_pointer_are_the_records() -> None:
    record = make_record()
    scores = data_of(html_of(record))["scores"]
    steps = np.frombuffer(base64.b64decode(scores["values"]), "<u2").reshape(40, 44)
    values = scores["low"] + steps / 65535 * (scores["high"] - scores["low"])
    np.testing.assert_allclose(values, record.similarity, atol=1e-5)
