import itertools
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.maps.fakes import FakeTechnique, frames

from retraverse.errors import ConfigError, FrameReadError, InputError
from retraverse.images import Frame
from retraverse.maps import describe_frames, describe_traverse
from retraverse.maps.describe import in_order
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.techniques import Description
from retraverse.types import ImageArray


@pytest.mark.parametrize("threads", [1, 2, 7, None])
def test_results_keep_the_order_of_the_items(threads: int | None) -> None:
    def slow_first(item: int) -> int:
        time.sleep(0.002 * (item % 3))
        return item * item

    assert list(in_order(slow_first, range(40), threads)) == [item * item for item in range(40)]


def test_no_items_give_no_results() -> None:
    assert list(in_order(str, [], 2)) == []


def test_items_are_taken_only_a_little_ahead() -> None:
    taken = 0

    def items() -> Iterator[int]:
        nonlocal taken
        for item in range(1000):
            taken += 1
            yield item

    results = in_order(lambda item: item, items(), 3)
    for item in range(50):
        assert next(results) == item
        assert taken <= item + 2 + 3 * 2
    results.close()


def test_the_first_error_in_order_is_raised_and_all_stops() -> None:
    done: list[int] = []

    def fails(item: int) -> int:
        if item == 5:
            time.sleep(0.02)
            raise ValueError("five")
        if item == 6:
            raise ValueError("six")
        done.append(item)
        return item

    results = in_order(fails, range(1000), 2)
    assert list(itertools.islice(results, 5)) == [0, 1, 2, 3, 4]
    with pytest.raises(ValueError, match="five"):
        next(results)
    assert len(done) < 20
    assert not _our_threads()


def test_closing_early_ends_the_threads() -> None:
    results = in_order(lambda item: item, range(1000), 4)
    next(results)
    results.close()
    assert not _our_threads()


def _our_threads() -> list[str]:
    return [t.name for t in threading.enumerate() if t.name.startswith("retraverse")]


def test_threads_below_one() -> None:
    with pytest.raises(ConfigError, match="threads: got 0, expected 1 or more"):
        list(in_order(str, [1], 0))


@pytest.mark.parametrize("threads", [1, 3])
def test_every_frame_is_described(threads: int) -> None:
    technique = FakeTechnique()
    drive = frames(9)
    got = list(describe_traverse(drive, technique, threads=threads))
    for frame, description in zip(drive, got, strict=True):
        expected = technique.describe(technique.read(frame))
        assert all(np.array_equal(description[name], expected[name]) for name in expected)


def test_described_frames_know_their_frame() -> None:
    spec = ThumbnailSpec(16)
    drive = frames(4)
    got = list(describe_frames(drive, FakeTechnique(), thumbnails=spec))
    assert [frame.record.name for frame in got] == [frame.name for frame in drive]
    assert [frame.record.timestamp_s for frame in got] == [None, 1 / 7, 2 / 7, None]
    assert len({frame.content for frame in got}) == 4
    assert all(frame.thumbnail is not None and frame.describe_s > 0 for frame in got)


class InBatches(FakeTechnique):
    """Describes up to five pictures at once, and notes how many it got."""

    def __init__(self) -> None:
        super().__init__()
        self.sizes: list[int] = []

    def batch_size(self) -> int:
        return 5

    def describe_batch(self, images: Sequence[ImageArray]) -> list[Description]:
        self.sizes.append(len(images))
        return [self.describe(image) for image in images]


@pytest.mark.parametrize("threads", [1, 3])
def test_batches_give_every_frame_in_order(threads: int) -> None:
    technique, drive = InBatches(), frames(33)
    got = list(describe_frames(drive, technique, threads=threads))
    assert sorted(technique.sizes, reverse=True) == [5] * 6 + [3]
    assert [frame.record.name for frame in got] == [frame.name for frame in drive]
    for frame, described in zip(drive, got, strict=True):
        expected = FakeTechnique().describe(technique.read(frame))
        assert np.array_equal(described.description["descriptor"], expected["descriptor"])
    assert all(frame.describe_s > 0 for frame in got)


def test_few_frames_are_not_worth_a_batch() -> None:
    technique = InBatches()
    assert len(list(describe_frames(frames(31), technique))) == 31
    assert not technique.sizes


def test_a_bad_frame_in_a_batch_names_itself() -> None:
    bad = Frame.from_array(np.full((6, 8, 3), 255, np.uint8), name="white.jpg")
    with pytest.raises(FrameReadError, match=r"white\.jpg"):
        list(describe_traverse([*frames(33), bad, *frames(3)], InBatches()))


def test_progress_watches_the_frames() -> None:
    seen: list[Any] = []

    def progress(items: Iterable[Any], *, total: int, label: str) -> Iterable[Any]:
        seen.append((total, label))
        return items

    list(describe_traverse(frames(3), FakeTechnique(), progress=progress))
    assert seen == [(3, "describing with fake")]


def test_a_frame_that_cannot_be_read_names_itself() -> None:
    bad = Frame.from_array(np.full((6, 8, 3), 255, np.uint8), name="white.jpg")
    with pytest.raises(FrameReadError, match=r"white\.jpg"):
        list(describe_traverse([*frames(3), bad, *frames(3)], FakeTechnique()))


@pytest.mark.parametrize("given", ["autumn/", Path("autumn")])
def test_a_path_is_no_traverse(given: Any) -> None:
    with pytest.raises(InputError, match=r"got the path 'autumn/?', expected a traverse; open it"):
        list(describe_traverse(given, FakeTechnique()))


def test_no_frames() -> None:
    with pytest.raises(InputError, match="no frames in it, expected at least one"):
        list(describe_traverse([], FakeTechnique()))
