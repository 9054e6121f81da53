import dataclasses
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from retraverse.errors import ConfigError, FrameReadError, ShapeError
from retraverse.images import Frame
from retraverse.types import ImageArray

Encoder = Callable[..., bytes]


def test_a_frame_of_a_file(scene: ImageArray, encoder: Encoder, tmp_path: Path) -> None:
    path = tmp_path / "0007.png"
    path.write_bytes(encoder(scene, "PNG"))
    frame = Frame.from_file(path, index=7)
    assert (frame.name, frame.index, frame.path, frame.timestamp_s) == ("0007.png", 7, path, None)
    assert frame.encoded() == frame.fingerprint() == path.read_bytes()
    assert frame.size == scene.shape[:2]
    np.testing.assert_array_equal(frame.colour(), scene)


def test_a_frame_reads_its_file_only_when_asked(tmp_path: Path) -> None:
    frame = Frame.from_file(tmp_path / "later.png")
    with pytest.raises(FrameReadError, match=r"cannot read .*later\.png: no such file"):
        frame.grey()


def test_frames_of_an_array_in_either_channel_order(scene: ImageArray) -> None:
    rgb = Frame.from_array(scene, index=3, timestamp_s=0.5)
    bgr = Frame.from_array(scene[..., ::-1], name="b", colour_order="bgr")
    assert (rgb.name, rgb.index, rgb.timestamp_s, rgb.path) == ("000003", 3, 0.5, None)
    assert bgr.name == "b"
    for frame in (rgb, bgr):
        assert frame.encoded() is None
        np.testing.assert_array_equal(frame.colour(), scene)
        # ITU-R BT.601 luma, which OpenCV rounds to the nearest level.
        luma = scene @ np.array([0.299, 0.587, 0.114])
        for grey in (frame.grey(), frame.grey("from_colour")):
            assert grey.dtype == np.uint8
            np.testing.assert_allclose(grey, luma, atol=0.51)
    assert rgb.fingerprint() != bgr.fingerprint()


def test_a_frame_of_a_grey_array(scene: ImageArray) -> None:
    grey = scene[:, :, 0]
    frame = Frame.from_array(grey)
    np.testing.assert_array_equal(frame.grey(), grey)
    np.testing.assert_array_equal(frame.colour(), np.dstack([grey] * 3))
    assert frame.size == grey.shape


def test_pixels_are_the_callers_own(scene: ImageArray) -> None:
    for array in (scene.copy(), scene[:, :, 0].copy()):
        frame = Frame.from_array(array)
        frame.grey()[:] = 0
        frame.colour()[:] = 0
        np.testing.assert_array_equal(array.any(), True)
        assert frame.colour().any()


def test_wrong_arrays_and_orders_are_refused(scene: ImageArray) -> None:
    with pytest.raises(ShapeError, match="float64"):
        Frame.from_array(scene / 255)
    with pytest.raises(ConfigError, match="'gbr', expected one of rgb, bgr"):
        Frame.from_array(scene, colour_order="gbr")  # type: ignore[arg-type]


def test_frames_compare_by_what_is_known_of_them_and_cannot_change(scene: ImageArray) -> None:
    frame = Frame.from_array(scene)
    assert frame == Frame.from_array(scene)
    assert frame != Frame.from_array(scene, index=1)
    assert len({frame, Frame.from_array(scene)}) == 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        frame.index = 3  # type: ignore[misc]


@pytest.mark.skipif(sys.platform == "darwin", reason="macOS allows only Unicode file names")
def test_a_file_name_that_is_not_unicode(
    scene: ImageArray, encoder: Encoder, tmp_path: Path
) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.png"))
    path.write_bytes(encoder(scene, "PNG"))
    frame = Frame.from_file(path)
    assert frame.name == r"caf\udce9.png"
    assert frame.name.encode()
    np.testing.assert_array_equal(frame.colour(), scene)
