"""`open_traverse`: whatever a user has for a drive, as a `Traverse`."""

import glob
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.errors import ConfigError, DataMissingError, FrameReadError, InputError, ShapeError
from retraverse.images.decode import ColourOrder, check_array, check_colour_order
from retraverse.images.files import (
    is_picture_name,
    missing_path,
    open_file_list,
    open_folder,
    open_pattern,
)
from retraverse.images.frame import Frame
from retraverse.images.pixels import ArrayPixels, ArraySequence
from retraverse.images.traverse import Traverse, skip_bad_frames
from retraverse.images.video import open_video
from retraverse.types import Array, Progress, no_progress

__all__ = ["Source", "open_traverse"]

Source = str | os.PathLike[str] | ArraySequence | Traverse
"""What `open_traverse` takes."""


def open_traverse(
    source: Source,
    *,
    every: int = 1,
    skip_bad: bool = False,
    colour_order: ColourOrder = "rgb",
    progress: Progress = no_progress,
) -> Traverse:
    """Return the frames of a drive, from whatever holds them.

    Parameters
    ----------
    source : path, pattern, sequence or Traverse
        - a folder: the pictures directly in it, in natural order (``2.jpg`` before
          ``10.jpg``); other files and hidden ones are passed over;
        - a glob pattern (``"drive/*/left*.png"``, ``**`` for any depth), in natural order;
        - one picture file, or a video file;
        - a list or tuple of paths or arrays, in the order given;
        - an array of shape (N, H, W) or (N, H, W, 3), or any object with ``len`` that gives
          an array for each number below it; it is asked for a frame only when its pixels
          are wanted, so it may be as long as it likes;
        - a `Traverse`, which comes back as it is.
    every : int >= 1
        Keep every `every`-th frame, the first included. `Frame.index` still counts them all.
    skip_bad : bool
        Decode every frame now and leave out those that cannot be read, listed in
        `Traverse.skipped`. Otherwise such a frame raises when it is read.
    colour_order : {"rgb", "bgr"}
        The order of the channels in arrays; files and videos know their own.
    progress : Progress
        Shows how far counting a video and checking frames have come.

    Returns
    -------
    traverse : Traverse
        It has at least one frame.

    Raises
    ------
    DataMissingError
        If nothing is there, or no picture is; the message says what was found instead.
    FrameReadError
        If a video cannot be opened, or with `skip_bad` no frame can be read.
    ShapeError
        If an array has the wrong shape or type.
    ConfigError
        If `every` or `colour_order` is out of range.

    Notes
    -----
    Arrays are uint8 or uint16 (upper 8 bits kept), (H, W), (H, W, 3) or (H, W, 4). Floats are
    refused, since 0..1 and 0..255 cannot be told apart. Frames may differ in size.

    Examples
    --------
    >>> import numpy as np
    >>> traverse = open_traverse(np.zeros((10, 48, 64), np.uint8), every=4)
    >>> [frame.index for frame in traverse]
    [0, 4, 8]
    """
    _check_every(every)
    check_colour_order(colour_order)
    traverse = _open(source, every, colour_order, progress).thinned(every)
    return skip_bad_frames(traverse, progress) if skip_bad else traverse


def _check_every(every: int) -> None:
    if not isinstance(every, int | np.integer) or isinstance(every, bool) or every < 1:
        raise ConfigError(f"every: got {every!r}, expected a whole number of at least 1")


def _open(source: Source, every: int, order: ColourOrder, progress: Progress) -> Traverse:
    if isinstance(source, Traverse):
        return source
    if isinstance(source, str | os.PathLike):
        return _open_path(os.fspath(source), every, progress)
    if isinstance(source, np.ndarray) and source.dtype.kind not in "UO":
        return _open_stack(source, order)
    if isinstance(source, list | tuple | np.ndarray):
        return _open_list(list(source), order)
    _check_is_sequence(source)
    return _open_lazy(source, order)


def _open_path(text: str, every: int, progress: Progress) -> Traverse:
    if not text:
        raise InputError("source: got an empty path, expected a folder, a pattern or a file")
    path = _expanded(text)
    # What exists is taken by its name even if that looks like a pattern, as "run[1]" does.
    if _exists(path):
        return open_folder(path) if path.is_dir() else _open_file(path, every, progress)
    if glob.has_magic(text):
        return open_pattern(str(path))
    raise missing_path(path)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:
        raise DataMissingError(f"{path}: cannot be looked up: {error.strerror}") from error


def _open_file(path: Path, every: int, progress: Progress) -> Traverse:
    if is_picture_name(path.name):
        return Traverse(path.stem, f"picture {path}", (Frame.from_file(path),))
    if not path.is_file():
        raise InputError(f"{path}: a device or pipe, expected a folder, a picture or a video")
    # OpenCV would show a text file as a film of its letters.
    if _is_text(path):
        raise InputError(f"{path}: a text file, expected a folder, a picture or a video")
    return open_video(path, every=every, progress=progress)


def _is_text(path: Path) -> bool:
    """Return whether a file begins with nothing but text, as no video format does."""
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise FrameReadError(f"cannot read {path}: {error.strerror}") from error
    if not head:
        raise FrameReadError(f"cannot read {path}: the file is empty")
    # The control codes that no text has; 9 to 13 are white space, 27 begins a colour code.
    controls = {*range(9), *range(14, 27), *range(28, 32)}
    return controls.isdisjoint(head)


def _open_list(items: list[Any], order: ColourOrder) -> Traverse:
    if not items:
        raise DataMissingError("source: the list is empty, expected paths or arrays")
    if all(isinstance(item, str | os.PathLike) for item in items):
        return open_file_list([_expanded(os.fspath(item)) for item in items])
    frames = tuple(
        Frame.from_file(_expanded(os.fspath(item)), index=index)
        if isinstance(item, str | os.PathLike)
        else _frame_of_array(items, index, order)
        for index, item in enumerate(items)
    )
    return Traverse("frames", f"list of {len(frames)} frames", frames)


def _open_stack(stack: Array, order: ColourOrder) -> Traverse:
    is_one_picture = stack.ndim == 2 or (stack.ndim == 3 and stack.shape[2] in (3, 4))
    if is_one_picture or stack.ndim not in (3, 4):
        hint = "; one picture goes in a list" if is_one_picture else ""
        raise ShapeError(
            f"source: got an array of shape {stack.shape}, expected (frames, height, width) or "
            f"(frames, height, width, 3){hint}"
        )
    traverse = _open_lazy(stack, order)
    try:
        check_array(stack[0])
    except ShapeError as error:
        raise ShapeError(f"source: got frames of {error}") from error
    return traverse


def _open_lazy(items: ArraySequence, order: ColourOrder) -> Traverse:
    n_frames = len(items)
    if n_frames == 0:
        raise DataMissingError("source: the sequence is empty, expected at least one frame")
    # A simulated drive, say, knows what it is called.
    name = getattr(items, "name", None)
    frames = tuple(_frame_of_array(items, index, order) for index in range(n_frames))
    source = f"{type(items).__name__} of {n_frames} arrays"
    return Traverse(name if isinstance(name, str) and name else "arrays", source, frames)


def _frame_of_array(items: ArraySequence, index: int, order: ColourOrder) -> Frame:
    return Frame(f"{index:06d}", index, pixels=ArrayPixels(items, index, order))


def _check_is_sequence(source: object) -> None:
    is_sequence = hasattr(source, "__len__") and hasattr(source, "__getitem__")
    if is_sequence and not isinstance(source, Mapping | bytes | bytearray):
        return
    hint = "; pass list(...) of it" if isinstance(source, Iterable) else ""
    raise InputError(
        f"source: got {type(source).__name__}, expected a folder, a pattern, a video, or a "
        f"sequence of paths or arrays{hint}"
    )


def _expanded(text: str) -> Path:
    path = Path(text)
    return path.expanduser() if path.parts[:1] == ("~",) else path
