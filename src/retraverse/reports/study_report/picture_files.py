"""Thumbnails of the matched pictures, as they were compressed, in files beside the pages."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, cast

from retraverse.datasets import GroundTruth
from retraverse.errors import RetraverseError
from retraverse.images import Frame, Traverse
from retraverse.reports.pictures import thumbnail
from retraverse.reports.study_report.artefacts import slug
from retraverse.reports.study_report.page_files import put
from retraverse.studies.keeping.records import RunRecord
from retraverse.types import ImageArray

if TYPE_CHECKING:
    from retraverse.images.jpeg import Encoder

__all__ = ["PictureFiles", "PictureSource", "Pictures", "Side"]

Side = Literal["query", "reference"]
_FEW = 24
"""New thumbnails that a condition may have in any case, while there are any left."""


class PictureSource(Protocol):
    """A dataset whose pictures are at hand."""

    def query(self) -> Traverse:
        """Return the drive that was located."""
        ...

    def reference(self) -> Traverse:
        """Return the map's drive."""
        ...

    def truth(self) -> GroundTruth:
        """Return which frames show one place."""
        ...


Pictures = Callable[[str], PictureSource | None]
"""Gives the pictures of a dataset by its name, None if they are not at hand."""


@dataclass
class PictureFiles:
    """Writes each thumbnail once, when it is first asked for, until there are enough."""

    out: Path
    pictures: Pictures | None
    most: int = 3000
    """Thumbnails of matches in the whole report at most."""
    granted: int | None = None
    """How many there may be by now, None = `most`; see `grant`."""
    written: dict[str, str] = field(default_factory=dict)
    """Name of a picture -> its address relative to the pages, "" where it cannot be had."""
    _n_written: int = 0
    _sources: dict[str, PictureSource | None] = field(default_factory=dict)
    _traverses: dict[tuple[str, ...], Traverse] = field(default_factory=dict)

    def source(self, dataset: str) -> PictureSource | None:
        """Return a dataset's pictures, None if they are not at hand."""
        if dataset not in self._sources:
            self._sources[dataset] = self.pictures(dataset) if self.pictures else None
        return self._sources[dataset]

    def truth(self, run: RunRecord) -> GroundTruth | None:
        """Return a dataset's truth if it is of the drives that a run was made on."""
        source = self.source(run.dataset)
        if source is None:
            return None
        try:
            truth = source.truth()
        except (RetraverseError, OSError):
            return None
        return truth if truth.n_queries == run.n_queries else None

    def address(self, run: RunRecord, side: Side, frame: int) -> str:
        """Return where the thumbnail of a frame lies, as `run` saw it; "" if there is none."""
        traverse = self._traverse(run, side)
        if traverse is None or not 0 <= frame < len(traverse):
            return ""
        name = f"{slug(run.dataset)}/{side[0]}{frame}-{_worsening_name(run, side)}"
        if name not in self.written:
            if self._n_written >= (self.most if self.granted is None else self.granted):
                return ""
            self.written[name] = self._write(traverse, frame, name)
            self._n_written += bool(self.written[name])
        return self.written[name]

    def grant(self, shares: int) -> None:
        """Allow one of `shares` equal shares of the thumbnails that are left, at least a few.

        So that the first of many runs do not take all of them.
        """
        left = self.most - self._n_written
        self.granted = min(self.most, self._n_written + max(_FEW, left // max(shares, 1)))

    def frame(self, run: RunRecord, side: Side, index: int) -> Frame | None:
        """Return a frame as `run` saw it, None if it is not at hand."""
        traverse = self._traverse(run, side)
        return None if traverse is None or not 0 <= index < len(traverse) else traverse[index]

    def drawn(self, run: RunRecord, name: str, pixels: ImageArray) -> str:
        """Write a picture made of a frame of `run`; return its address.

        Parameters
        ----------
        run : RunRecord
        name : str
            Tells it from the other pictures of the dataset.
        pixels : uint8 array, shape (H, W, 3)
        """
        jpeg = thumbnail(pixels)[0]
        content = hashlib.sha256(jpeg).hexdigest()[:8]
        address = f"pictures/{slug(run.dataset)}/{slug(name)}-{content}.jpg"
        put(self.out / address, jpeg)
        return address

    def frame_name(self, run: RunRecord, side: Side, frame: int) -> str:
        """Return the file name of a frame, "" if the pictures are not at hand."""
        traverse = self._traverse(run, side)
        known = traverse is not None and 0 <= frame < len(traverse)
        return traverse[frame].name if traverse is not None and known else ""

    def _traverse(self, run: RunRecord, side: Side) -> Traverse | None:
        source = self.source(run.dataset)
        if source is None:
            return None
        if _compression(run, side) >= 0 and "tables=" in run.encoder:
            return None  # a record does not hold the tables themselves
        key = (run.dataset, side, _worsening_name(run, side))
        if key not in self._traverses:
            try:
                plain = source.query() if side == "query" else source.reference()
            except (RetraverseError, OSError):
                self._sources[run.dataset] = None
                return None
            expected = run.n_queries if side == "query" else run.n_references
            if len(plain) != expected:  # the folder changed since, or was thinned
                self._sources[run.dataset] = None
                return None
            self._traverses[key] = _worsened(plain, run, side)
        return self._traverses[key]

    def _write(self, traverse: Traverse, frame: int, name: str) -> str:
        """Write one thumbnail and return its address; one made before of the same is kept."""
        try:
            content = hashlib.sha256(traverse[frame].fingerprint()).hexdigest()[:8]
            address = f"pictures/{name}-{content}.jpg"
            if not (self.out / address).is_file():
                put(self.out / address, thumbnail(traverse[frame].colour())[0])
        except (RetraverseError, OSError):
            return ""
        return address


def _compression(run: RunRecord, side: Side) -> int:
    return run.compression_query if side == "query" else run.compression_reference


@lru_cache(maxsize=4096)
def _worsening(damage: str, encoder: str, resize: int, resizer: str) -> str:
    parts = [damage]
    if damage.startswith("c") and encoder:
        parts.append(slug(encoder))
    if resize:
        parts.append(f"{resize}px-{slug(resizer)}")
    return "-".join(parts)


def _worsening_name(run: RunRecord, side: Side) -> str:
    return _worsening(_damage(run, side), run.encoder, run.resize, run.resizer)


def _damage(run: RunRecord, side: Side) -> str:
    """Return a name for what was done to pictures of any size: "c50", "as-is", "av1-36-by-8"."""
    if run.video and side == "query":
        return f"{slug(run.video)}-{run.video_quality}-by-{run.group_length}"
    compression = _compression(run, side)
    if compression < 0:
        return "as-is"
    return f"c{compression}" + (f"-{slug(run.jpeg_part)}" if run.jpeg_part else "")


def _worsened(traverse: Traverse, run: RunRecord, side: Side) -> Traverse:
    """Return the pictures as the run saw them."""
    from retraverse.images import VideoGroups, Worsening, worsened

    compression = _compression(run, side)
    video = None
    if run.video and side == "query":
        video = VideoGroups(cast(Any, run.video), run.video_quality, run.group_length)
    worsening = Worsening(
        resize=run.resize or None,
        resizer="opencv" if run.resizer.startswith("opencv") else "pillow",
        compression=compression if compression >= 0 else None,
        encoder=_encoder(run.encoder),
        part=run.jpeg_part if compression >= 0 else "",
        video=video,
    )
    return worsened(traverse, worsening)


def _encoder(label: str) -> "Encoder":
    """Return the encoder of a record's label, such as "pillow 4:2:0 optimize"."""
    from retraverse.images.jpeg import Encoder

    words = label.split()
    known = {"4:4:4", "4:2:2", "4:2:0"} & set(words)
    return Encoder(
        subsampling=cast(Any, next(iter(known), "4:2:0")),
        library="opencv" if words[:1] == ["opencv"] else "pillow",
    )
