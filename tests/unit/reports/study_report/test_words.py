"""What records are called on the pages."""

import pytest

from retraverse.reports.study_report.words import dataset_order, dataset_title


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("corridor", "Corridor"),
        ("nordland_64x32, with jumps", "Nordland 64x32, every 20th, with jumps"),
        ("mine", "mine"),
        ("mine, varying speed", "mine, varying speed"),
        ("corridor, elsewhere", "corridor, elsewhere"),
    ],
)
def test_a_dataset_keeps_its_title_at_another_speed(name: str, title: str) -> None:
    assert dataset_title(name) == title


def test_a_dataset_stands_beside_itself_at_another_speed() -> None:
    names = ["mine, with stops", "stromovka", "corridor, with stops", "mine", "corridor"]
    ordered = ["corridor", "corridor, with stops", "stromovka", "mine", "mine, with stops"]
    assert sorted(names, key=dataset_order) == ordered
