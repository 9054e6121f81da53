"""Pictures to batches: views stay inside, JPEG is the codec's own, folders are read as they are."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.unit.training.tiny import pictures, write_pictures

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.training.pictures import (
    LARGEST_SIDE,
    CompressionMix,
    View,
    ViewSettings,
    draw_view,
    labelled_pictures,
    load_pictures,
    nearby_view,
    seen_through_jpeg,
    take_view,
)


@pytest.mark.parametrize("shape", [(60, 80), (150, 150), (8, 300), (300, 8), (1, 1)])
def test_views_lie_inside_the_picture(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    picture = np.zeros((*shape, 3), np.uint8)
    for _ in range(50):
        view = draw_view(random, shape, ViewSettings())
        for one in (view, nearby_view(random, view, shape)):
            assert one.left >= 0
            assert one.top >= 0
            assert one.width >= 1
            assert one.height >= 1
            assert one.left + one.width <= shape[1]
            assert one.top + one.height <= shape[0]
            assert take_view(picture, one, random).shape == (*one.size[::-1], 3)


def test_a_nearby_view_is_nearer_and_not_far_off() -> None:
    random = np.random.default_rng(1)
    view = draw_view(random, (150, 150), ViewSettings())
    for _ in range(50):
        other = nearby_view(random, view, (150, 150))
        assert 0.75 * view.width <= other.width <= view.width
        assert abs(other.left - view.left) <= 0.4 * view.width
        assert other.size == view.size


def test_a_view_is_the_crop_it_says() -> None:
    picture = pictures(2, 1)[0]
    plain = View(10, 5, 40, 30, (40, 30), False, False, 1.0, 1.0)
    random = np.random.default_rng(0)
    assert np.array_equal(take_view(picture, plain, random), picture[5:35, 10:50])
    mirrored = View(10, 5, 40, 30, (40, 30), True, False, 1.0, 1.0)
    assert np.array_equal(take_view(picture, mirrored, random), picture[5:35, 10:50][:, ::-1])
    darker = View(10, 5, 40, 30, (40, 30), False, True, 0.5, 1.0)
    seen = take_view(picture, darker, random)
    assert (seen[..., 0] == seen[..., 1]).all()
    assert seen.max() <= 128


@pytest.mark.parametrize("compression", [0, 50, 97, 99])
def test_jpeg_is_pillows_own(compression: int) -> None:
    picture = pictures(3, 1)[0]
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=100 - compression)
    expected = np.asarray(Image.open(buffer).convert("RGB"), np.int16)
    got = seen_through_jpeg(picture, compression).astype(np.int16)
    # Two builds of the decoder may round a level apart.
    assert np.abs(got - expected).max() <= 2
    assert seen_through_jpeg(picture, None) is picture


def test_mix_draws_what_it_says() -> None:
    mix = CompressionMix(clean=0.25, bands=((3, 95, 99), (1, 10, 20)))
    random = np.random.default_rng(0)
    drawn = [mix.draw(random) for _ in range(4000)]
    assert drawn.count(None) / 4000 == pytest.approx(0.25, abs=0.03)
    strong = [c for c in drawn if c is not None and 95 <= c <= 99]
    weak = [c for c in drawn if c is not None and 10 <= c <= 20]
    assert len(strong) + len(weak) + drawn.count(None) == 4000
    assert len(strong) / len(weak) == pytest.approx(3, abs=0.4)
    assert set(strong) == {95, 96, 97, 98, 99}
    assert CompressionMix(clean=0, bands=((1.0, 97, 97),)).draw(random) == 97


@pytest.mark.parametrize(
    "wrong", [{"clean": -0.1}, {"bands": ((1, 50, 40),)}, {"bands": ((1, 0, 100),)}]
)
def test_mix_out_of_range(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="got"):
        CompressionMix(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong", [{"smallest_crop": 0}, {"shapes": (2.0, 1.0)}, {"widths": (4, 100)}]
)
def test_views_out_of_range(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="got"):
        ViewSettings(**wrong)  # type: ignore[arg-type]


def test_folders_of_folders_and_traverses(tmp_path: Path) -> None:
    images = pictures(5)
    write_pictures(tmp_path / "both" / "a", images[:4])
    write_pictures(tmp_path / "both" / "b" / "c", images[4:])
    found = load_pictures(tmp_path / "both")
    assert all(np.array_equal(*pair) for pair in zip(found, images, strict=True))
    assert len(load_pictures(tmp_path / "both" / "a")) == 4
    drive = rt.open_traverse(tmp_path / "both" / "a")
    assert np.array_equal(load_pictures(drive, limit=2)[1], images[2])


def test_large_pictures_are_made_smaller(tmp_path: Path) -> None:
    write_pictures(tmp_path / "large", [np.zeros((100, 1000, 3), np.uint8)])
    assert load_pictures(tmp_path / "large")[0].shape == (32, LARGEST_SIDE, 3)


def test_no_pictures(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for source in (tmp_path / "empty", tmp_path / "missing"):
        with pytest.raises(InputError, match=source.name):
            load_pictures(source)
    with pytest.raises(DataMissingError, match="missing"):
        labelled_pictures(tmp_path / "missing")


def test_classes_are_folders(tmp_path: Path) -> None:
    images = pictures(6)
    write_pictures(tmp_path / "set" / "b", images[:2])
    with pytest.raises(InputError, match="got 1 classes, expected at least 2"):
        labelled_pictures(tmp_path / "set")
    write_pictures(tmp_path / "set" / "a", images[2:])
    found = labelled_pictures(tmp_path / "set")
    assert found.classes == ("a", "b")
    assert found.labels == (0, 0, 0, 0, 1, 1)
    assert len(labelled_pictures(tmp_path / "set", limit=2).pictures) == 2
