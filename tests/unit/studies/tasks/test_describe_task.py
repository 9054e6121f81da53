"""Describing tasks over pictures that were never files."""

import hashlib

import numpy as np
import pytest

import retraverse as rt
from retraverse.images import Frame, Worsening
from retraverse.images.worsen import worsened
from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.studies.tasks.describe_task import DescribeTask, Wanted, describe_task
from retraverse.types import ImageArray

HOG = TechniqueChoice("hog", {"resolution": 64})


def drive(*shape: int) -> list[ImageArray]:
    random = np.random.default_rng(4)
    return [random.integers(0, 256, shape).astype(np.uint8) for _ in range(3)]


def task(frames: tuple[Frame, ...], *wanted: Wanted) -> DescribeTask:
    digests = tuple(hashlib.sha256(frame.fingerprint()).digest() for frame in frames)
    return DescribeTask("noise", frames, digests, wanted)


@pytest.mark.parametrize("shape", [(48, 64), (48, 64, 3)])
@pytest.mark.parametrize("resize", [None, 32])
def test_arrays_become_jpeg_of_their_own_kind(shape: tuple[int, ...], resize: int | None) -> None:
    pictures = drive(*shape)
    frames = rt.open_traverse(pictures).frames
    way = Worsening(resize=resize, compression=50)
    wanted = (Wanted("sizes", way, None), Wanted("hog", way, HOG))
    entries = describe_task(task(frames, *wanted)).entries
    # Grey stays grey: a colour file of the same picture is larger.
    expected = worsened(rt.open_traverse(pictures), way)
    sizes = [len(frame.encoded() or b"") for frame in expected]
    assert entries["sizes"]["n_bytes"].tolist() == sizes
    made = HOG.make()
    described = [made.describe(made.read(frame))["descriptor"] for frame in expected]
    np.testing.assert_array_equal(entries["hog"]["descriptor"], np.stack(described))


def test_an_array_is_asked_for_once_whatever_is_wanted() -> None:
    pictures = drive(48, 64)
    asked: list[int] = []

    class Counted:
        def __len__(self) -> int:
            return len(pictures)

        def __getitem__(self, index: int, /) -> ImageArray:
            asked.append(index)
            return pictures[index]

    made = task(
        rt.open_traverse(Counted()).frames,
        *(Wanted(f"sizes {c}", Worsening(compression=c), None) for c in (10, 50, 90)),
        Wanted("hog", Worsening(), HOG),
    )
    asked.clear()
    assert len(describe_task(made).entries) == 4
    assert asked == [0, 1, 2]


def test_an_array_that_changed_meanwhile_is_told() -> None:
    pictures = drive(48, 64)
    made = task(rt.open_traverse(pictures).frames, Wanted("sizes", Worsening(), None))
    pictures[1][0, 0] ^= 255
    errors = describe_task(made).errors
    assert list(errors) == ["sizes"]
    assert "changed while the study ran" in errors["sizes"]
