import itertools

import numpy as np
import pytest
from tests.unit.maps.fakes import FakeTechnique, frames

from retraverse.errors import ShapeError
from retraverse.maps import segment as room
from retraverse.maps.describe import DescribedFrame, describe_frames
from retraverse.maps.segment import Segment, gather, split_small_end
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.techniques import ArraySpec, Layout

LAYOUT = FakeTechnique().layout


def described(n_frames: int, *, thumbnails: bool = True) -> list[DescribedFrame]:
    spec = ThumbnailSpec(16) if thumbnails else None
    return list(describe_frames(frames(n_frames), FakeTechnique(), thumbnails=spec))


def comparable(frame: DescribedFrame) -> tuple[object, ...]:
    arrays = {name: array.tolist() for name, array in frame.description.items()}
    return frame.record, arrays, frame.content, frame.thumbnail


@pytest.mark.parametrize("limit", [1, 500, 5000, 1 << 20])
def test_segments_keep_to_their_size_and_lose_nothing(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "SEGMENT_BYTES", limit)
    drive = described(17)
    segments = list(gather(drive, LAYOUT))
    rows = [comparable(row) for segment in segments for row in segment.rows()]
    assert rows == [comparable(frame) for frame in drive]
    assert all(segment.n_bytes <= limit or len(segment) == 1 for segment in segments)
    # As full as they can be: no two neighbours would fit one.
    for first, second in itertools.pairwise(segments):
        assert first.n_bytes + second.n_bytes > limit


@pytest.mark.parametrize("thumbnails", [True, False])
def test_tensors_are_what_the_specs_promise(thumbnails: bool) -> None:
    (segment,) = gather(described(5, thumbnails=thumbnails), LAYOUT)
    specs = Segment.tensor_specs(5, LAYOUT, position_columns=0, has_thumbnails=thumbnails)
    tensors = segment.tensors()
    assert tensors.keys() == specs.keys()
    for name, (dtype, shape) in specs.items():
        assert tensors[name].dtype == dtype
        assert all(
            want in (None, got) for got, want in zip(tensors[name].shape, shape, strict=True)
        )
    again = Segment.from_tensors(tensors, "file")
    assert [comparable(a) for a in again.rows()] == [comparable(b) for b in segment.rows()]


def test_descriptors_are_read_only() -> None:
    (segment,) = gather(described(2), LAYOUT)
    with pytest.raises(ValueError, match="read-only"):
        segment.descriptions.descriptor[0] = 1


def test_a_description_that_breaks_its_promise_is_refused() -> None:
    layout = Layout("global", {**LAYOUT.arrays, "descriptor": ArraySpec((99,), "float32")})
    with pytest.raises(ShapeError, match=r"'descriptor'.*expected float32 \(99,\)"):
        list(gather(described(2), layout))


def test_only_a_small_last_segment_is_written_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = described(12)
    size = Segment.stack(drive[:4], LAYOUT).n_bytes
    monkeypatch.setattr(room, "SEGMENT_BYTES", size)
    big, small = Segment.stack(drive[:4], LAYOUT), Segment.stack(drive[4:5], LAYOUT)
    assert split_small_end((small, big)) == ((small, big), ())
    kept, rows = split_small_end((big, small))
    assert kept == (big,)
    assert [comparable(row) for row in rows] == [comparable(drive[4])]


def test_content_has_one_digest_a_frame() -> None:
    (segment,) = gather(described(3), LAYOUT)
    assert segment.content.shape == (3, 32)
    assert segment.content.dtype == np.uint8
