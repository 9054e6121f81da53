import pytest

from retraverse.images import natural_key


@pytest.mark.parametrize(
    "ordered",
    [
        ["1.jpg", "2.jpg", "10.jpg", "100.jpg"],
        ["0000002.jpg", "0000010.jpg"],
        ["01.jpg", "1.jpg", "002.jpg", "02.jpg"],
        ["a2b1.png", "a2b10.png", "a10b1.png"],
        ["IMG_2.JPG", "img_10.jpg", "IMG_11.JPG"],
        ["frame.jpg", "frame1.jpg", "frame2.jpg", "frame10.jpg"],
        ["1.5.jpg", "1.10.jpg"],
        ["1.jpg", "1.png"],
        ["a/9.jpg", "a/10.jpg", "a b/1.jpg", "b/1.jpg"],
        ["left2/1.jpg", "left10/1.jpg"],
        ["9.jpg", "a.jpg"],
        ["²x.jpg", "³x.jpg"],
        ["é1.jpg", "é2.jpg", "é10.jpg"],
        ["٢.jpg", "٣.jpg"],
    ],
)
def test_names_sort_as_people_count(ordered: list[str]) -> None:
    reversed_names = ordered[::-1]
    assert sorted(reversed_names, key=natural_key) == ordered


def test_very_long_numbers_are_compared() -> None:
    short, long = "9" * 5000, "1" + "0" * 5000
    assert natural_key(f"{short}.jpg") < natural_key(f"{long}.jpg")
