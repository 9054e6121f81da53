"""Laws of ordering, slicing and thinning that hold for any names and numbers."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from retraverse.images import Frame, Traverse, natural_key, open_traverse
from retraverse.images.decode import check_array, to_grey, to_rgb

NAME_PARTS = st.sampled_from(
    [*"aBé _-.0129", "00", "007", "10", "²", "٣", "img", "IMG", ".jpg", ".PNG", "/"]
)
PIXEL = np.zeros((1, 1), np.uint8)
names = st.one_of(st.lists(NAME_PARTS, min_size=1, max_size=8).map("".join), st.text(max_size=12))
frames_of_nothing = st.integers(0, 30).map(
    lambda n: Traverse("t", "s", tuple(Frame.from_array(PIXEL, index=3 * i) for i in range(n)))
)


@given(st.lists(names, unique=True, max_size=12), st.randoms(use_true_random=False))
def test_natural_order_is_total_and_does_not_depend_on_the_input(
    names: list[str], random: Any
) -> None:
    ordered = sorted(names, key=natural_key)
    random.shuffle(names)
    assert sorted(names, key=natural_key) == ordered
    assert len({natural_key(name) for name in names}) == len(names)


@given(st.sampled_from(["", "img", "left/", "a.b"]), st.lists(st.integers(0, 10**12), unique=True))
def test_numbers_in_names_sort_as_numbers(prefix: str, numbers: list[int]) -> None:
    names = [f"{prefix}{number}.jpg" for number in numbers]
    assert sorted(names, key=natural_key) == [f"{prefix}{number}.jpg" for number in sorted(numbers)]


@given(st.lists(st.integers(0, 10**6), unique=True), st.integers(7, 12))
def test_padded_numbers_sort_as_text_does(numbers: list[int], width: int) -> None:
    names = [f"{number:0{width}d}.png" for number in numbers]
    assert sorted(names, key=natural_key) == sorted(names)


@given(frames_of_nothing, st.slices(30), st.slices(30))
def test_slices_follow_those_of_lists(traverse: Traverse, first: slice, second: slice) -> None:
    listed = list(traverse)
    assert list(traverse[first]) == listed[first]
    assert list(traverse[first][second]) == listed[first][second]
    assert list(traverse[first].indices) == [frame.index for frame in listed[first]]


@given(frames_of_nothing, st.integers(1, 9), st.integers(1, 9))
def test_thinning_twice_is_thinning_once_by_the_product(traverse: Traverse, a: int, b: int) -> None:
    twice = open_traverse(open_traverse(traverse, every=a), every=b)
    assert list(twice) == list(open_traverse(traverse, every=a * b))
    assert len(twice) == -(-len(traverse) // (a * b))


pictures = st.tuples(
    st.integers(1, 6), st.integers(1, 6), st.sampled_from([None, 1, 3, 4])
).flatmap(
    lambda shape: st.binary(
        min_size=shape[0] * shape[1] * (shape[2] or 1),
        max_size=shape[0] * shape[1] * (shape[2] or 1),
    ).map(
        lambda values: np.frombuffer(values, np.uint8).reshape(
            [side for side in shape if side is not None]
        )
    )
)


@given(pictures)
def test_channel_orders_mirror_each_other(array: np.ndarray[Any, np.dtype[np.uint8]]) -> None:
    picture = check_array(array)
    mirrored = picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., ::-1])
    np.testing.assert_array_equal(to_grey(picture, "rgb"), to_grey(mirrored, "bgr"))
    np.testing.assert_array_equal(to_rgb(picture, "rgb"), to_rgb(mirrored, "bgr"))
    assert to_rgb(picture, "rgb").shape == (*array.shape[:2], 3)
