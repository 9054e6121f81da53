"""`Traverse`: the frames of one drive, in order."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike

from retraverse.errors import FrameReadError, InputError, ShapeError
from retraverse.images.frame import Frame
from retraverse.types import IntArray, Progress, no_progress

__all__ = ["SkippedFrame", "Traverse", "skip_bad_frames"]


@dataclass(frozen=True)
class SkippedFrame:
    """A frame that was left out because it cannot be read."""

    name: str
    index: int
    """Frame number in the source, from 0."""
    reason: str
    """One clause, without the name."""


@dataclass(frozen=True)
class Traverse(Sequence[Frame]):
    """The frames of one drive, in order: a sequence that can be walked any number of times.

    It holds no pixels. `traverse[i]` is a `Frame`, `traverse[a:b]` a `Traverse` whose
    frames keep their `index`.
    """

    name: str
    """Short, for titles: the folder's or the video's name."""
    source: str
    """What was opened and how, in words, for provenance."""
    frames: tuple[Frame, ...] = field(repr=False)
    skipped: tuple[SkippedFrame, ...] = ()
    """What opening the source left out; slices keep the whole list."""

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[Frame]:
        return iter(self.frames)

    @overload
    def __getitem__(self, which: SupportsIndex) -> Frame: ...
    @overload
    def __getitem__(self, which: slice) -> "Traverse": ...
    def __getitem__(self, which: SupportsIndex | slice) -> "Frame | Traverse":
        if isinstance(which, slice):
            source = f"{self.source}[{_slice_text(which)}]"
            return replace(self, source=source, frames=self.frames[which])
        return self.frames[which]

    @property
    def indices(self) -> IntArray:
        """Frame numbers in the source, int64 (len,): what ground truth is selected by."""
        return np.fromiter((frame.index for frame in self.frames), np.int64, len(self.frames))

    def thinned(self, every: int) -> "Traverse":
        """Return every `every`-th frame, the first one included."""
        if every == 1:
            return self
        source = f"{self.source}, 1 frame of every {every}"
        return replace(self, source=source, frames=self.frames[::every])

    def take(self, frames: ArrayLike) -> "Traverse":
        """Return the frames of these numbers, in this order; a number may come more than once.

        Parameters
        ----------
        frames : int array, shape (N,)
            Positions in this traverse, from 0. The frames keep their `index`.

        Raises
        ------
        ShapeError
            If these are not whole numbers of one axis.
        InputError
            If a number lies outside the traverse.
        """
        numbers = np.asarray(frames)
        if numbers.ndim != 1 or (numbers.size and numbers.dtype.kind not in "iu"):
            raise ShapeError(
                f"frames: got {numbers.dtype} of shape {numbers.shape}, expected whole numbers "
                "of one axis"
            )
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < len(self)):
            raise InputError(
                f"frames: got numbers {numbers.min()} to {numbers.max()}, "
                f"expected 0 to {len(self) - 1} ({self.name})"
            )
        source = f"{self.source}, {numbers.size} frames taken by number"
        return replace(self, source=source, frames=tuple(self.frames[i] for i in numbers.tolist()))

    def content_hash(self, progress: Progress = no_progress) -> str:
        """Return the SHA-256 of all names and contents, in order, as 64 hexadecimal digits.

        Picture files count by their bytes, arrays by shape and values, frames of a
        video by the file's bytes and the frame number. Where the frames lie does not count.

        Parameters
        ----------
        progress : Progress
            Shows how far it has come.

        Raises
        ------
        FrameReadError
            If a frame cannot be read.
        """
        digest = hashlib.sha256()
        for frame in progress(self.frames, total=len(self), label=f"hashing {self.name}"):
            # Digests have one length, so no name can run into the contents after it.
            digest.update(hashlib.sha256(frame.name.encode()).digest())
            digest.update(hashlib.sha256(frame.fingerprint()).digest())
        return digest.hexdigest()


def skip_bad_frames(traverse: Traverse, progress: Progress = no_progress) -> Traverse:
    """Decode every frame once and return the traverse without those that cannot be read.

    Parameters
    ----------
    traverse : Traverse
    progress : Progress
        Shows how far it has come.

    Returns
    -------
    readable : Traverse
        `skipped` lists the others with the reasons.

    Raises
    ------
    FrameReadError
        If no frame at all can be read.
    """
    good, bad = [], list(traverse.skipped)
    for frame in progress(traverse.frames, total=len(traverse), label=f"checking {traverse.name}"):
        reason = _why_unreadable(frame)
        if reason is None:
            good.append(frame)
        else:
            bad.append(SkippedFrame(frame.name, frame.index, reason))
    if traverse.frames and not good:
        raise FrameReadError(
            f"{traverse.source}: none of {len(traverse)} frames can be read; the first, "
            f"{bad[-len(traverse)].name}: {bad[-len(traverse)].reason}"
        )
    source = f"{traverse.source}, {len(bad)} skipped" if bad else traverse.source
    return replace(traverse, source=source, frames=tuple(good), skipped=tuple(bad))


def _why_unreadable(frame: Frame) -> str | None:
    try:
        # Colour, because damage to the colour planes does not show in grey.
        frame.pixels.rgb()
    except (FrameReadError, ShapeError) as error:
        return str(error)
    return None


def _slice_text(which: slice) -> str:
    ends = [which.start, which.stop, *([] if which.step is None else [which.step])]
    return ":".join("" if end is None else str(end) for end in ends)
