"""The thesis' numbers: whole, in their places, and internally consistent."""

import pytest

from retraverse.datasets.known import known_dataset
from retraverse.reports.study_report.published import (
    BY_CHAPTER,
    published_table,
    published_value,
)


@pytest.mark.parametrize(
    ("number", "row", "column", "dataset", "expected"),
    [
        ("3.1", "netvlad", "campus_loop", "", "0.998"),
        ("4.1", "calc", "nordland", "", "107"),
        ("4.4", "calc", "K", "nordland", "13"),
        ("5.1", "essex3in1", "0", "", "1100"),
        ("6.1", "regionvlad", "99", "essex3in1", "0.27"),
        ("6.6", "hog_query", "t_total", "17_places", "423.512"),
        ("7.3", "orb", "256", "17_places", "396.17"),
        ("7.2", "orb", "64", "", ""),
        ("7.2", "sift", "64", "", ""),
        ("9.9", "hog", "64", "", ""),
    ],
)
def test_values_are_as_printed(
    number: str, row: str, column: str, dataset: str, expected: str
) -> None:
    assert published_value(number, row, column, dataset) == expected


@pytest.mark.parametrize(
    "dataset", ["essex3in1", "campus_loop", "gardens_point_night", "17_places"]
)
def test_times_of_chapter_6_add_up(dataset: str) -> None:
    number = {"essex3in1": "6.3", "campus_loop": "6.4", "gardens_point_night": "6.5"}
    table = published_table(number.get(dataset, "6.6"), dataset)
    assert table is not None
    for row in table.rows:
        matching, encoding, total = (
            float(table.value(row, column)) for column in ("t_m", "t_e K", "t_VPR")
        )
        assert matching + encoding == pytest.approx(total, rel=2e-3), row


def test_rows_are_as_long_as_their_heads_and_datasets_are_known() -> None:
    for chapter, datasets in BY_CHAPTER.items():
        assert all(known_dataset(name) for name in datasets), chapter
    for number in ("3.1", "4.1", "4.2", "5.1", "6.2", "7.1", "7.2"):
        table = published_table(number)
        assert table is not None
        assert {len(values) for values in table.rows.values()} == {len(table.columns)}
