"""The manifest of a map: what it holds, how it was made, and which files belong to it.

The manifest decides: a file it does not name is no part of the map, and a map changes in the
one instant in which its manifest is replaced. It carries its own checksum and must be, byte
for byte, what this program would write; checksums find damage, they do not prove an author.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from retraverse.errors import MapError
from retraverse.maps.provenance import Step, TechniqueRecord
from retraverse.maps.tensor_file import FileSeal
from retraverse.maps.thumbnails import ThumbnailSpec

__all__ = ["FORMAT", "FORMAT_VERSION", "OPENING", "Manifest", "SegmentFile", "is_segment_name"]

FORMAT = "retraverse-map"
FORMAT_VERSION = 1
OPENING = f'{{\n "format": "{FORMAT}",\n'.encode()
"""How every manifest starts, whatever its version."""

value_ = TypeVar("value_")

_segment_name = re.compile(r"\d{6,9}-[0-9a-f]{16}\.safetensors", re.ASCII)
_digest = re.compile(r"[0-9a-f]{64}", re.ASCII)


@dataclass(frozen=True)
class SegmentFile:
    """One file of the folder ``segments``."""

    name: str
    n_frames: int
    seal: FileSeal


@dataclass(frozen=True)
class Manifest:
    """All that ``manifest.json`` says."""

    technique: TechniqueRecord
    history: tuple[Step, ...]
    content_sha256: str
    """SHA-256 of all names and pictures, in route order."""
    position_columns: int
    """0, 1 or 2."""
    thumbnails: ThumbnailSpec | None
    segments: tuple[SegmentFile, ...]

    @property
    def n_frames(self) -> int:
        """Frames of the whole map."""
        return sum(segment.n_frames for segment in self.segments)

    @property
    def checksum(self) -> str:
        """SHA-256 over everything else in the manifest."""
        return hashlib.sha256(_render(self._body())).hexdigest()

    def render(self) -> bytes:
        """Return the file's bytes."""
        return _render({**self._body(), "checksum": self.checksum})

    def _body(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "technique": self.technique.to_json(),
            "n_frames": self.n_frames,
            "position_columns": self.position_columns,
            "thumbnails": None if self.thumbnails is None else asdict(self.thumbnails),
            "content_sha256": self.content_sha256,
            "history": [asdict(step) for step in self.history],
            "segments": [
                {"file": file.name, "n_frames": file.n_frames, **asdict(file.seal)}
                for file in self.segments
            ],
        }

    @classmethod
    def parse(cls, content: bytes, what: str) -> "Manifest":
        """Return the manifest that `content` says.

        Raises
        ------
        MapError
            If it is foreign, newer, edited or damaged; the message starts with `what`.
        """
        if not content.startswith(OPENING):
            raise MapError(f"{what}: not the manifest of a retraverse map; wrong folder?")
        try:
            record = json.loads(content, parse_constant=_refuse_constant)
            version = _take(record, "format_version", int)
            if version != FORMAT_VERSION:
                raise MapError(
                    f"{what}: written in map format {version}, this program reads format "
                    f"{FORMAT_VERSION}; install a newer retraverse"
                )
            manifest = cls._from_json(record)
            if (
                manifest.n_frames != sum(step.n_frames for step in manifest.history)
                or not manifest.n_frames
            ):
                raise ValueError("the frames of its segments and of its history differ")
            rendered = manifest.render()
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            if isinstance(error, MapError):
                raise
            raise MapError(f"{what}: damaged: {_one_line(error)}") from error
        if rendered != content:
            raise MapError(f"{what}: its checksum does not fit; edited by hand, or damaged")
        return manifest

    @classmethod
    def _from_json(cls, record: dict[str, Any]) -> "Manifest":
        thumbnails = record["thumbnails"]
        return cls(
            technique=TechniqueRecord.from_json(_take(record, "technique", dict)),
            history=tuple(_step(step) for step in _take(record, "history", list)),
            content_sha256=_take_digest(record, "content_sha256"),
            position_columns=_take_count(record, "position_columns", 0, 2),
            thumbnails=None if thumbnails is None else _thumbnails(thumbnails),
            segments=tuple(_segment_file(file) for file in _take(record, "segments", list)),
        )


def is_segment_name(name: str) -> bool:
    """Tell whether a file name is one that this program gives to segments."""
    return _segment_name.fullmatch(name) is not None


def _render(record: Mapping[str, Any]) -> bytes:
    return (json.dumps(record, indent=1, allow_nan=False) + "\n").encode("ascii")


def _refuse_constant(text: str) -> None:
    raise ValueError(f"{text} is no number")


def _take(record: Mapping[str, Any], key: str, kind: type[value_]) -> value_:
    value = record[key]
    if type(value) is not kind:
        raise TypeError(f"{key!r} is {type(value).__name__}, expected {kind.__name__}")
    return value


def _take_count(record: Mapping[str, Any], key: str, low: int, high: int) -> int:
    count = _take(record, key, int)
    if not low <= count <= high:
        raise ValueError(f"{key!r} is {count}, expected {low} to {high}")
    return count


def _take_digest(record: Mapping[str, Any], key: str) -> str:
    digest = _take(record, key, str)
    if not _digest.fullmatch(digest):
        raise ValueError(f"{key!r} is no SHA-256 checksum")
    return digest


def _thumbnails(record: dict[str, Any]) -> ThumbnailSpec:
    return ThumbnailSpec(_take(record, "max_side", int), _take(record, "quality", int))


def _step(record: dict[str, Any]) -> Step:
    text = ("action", "source", "created_at", "retraverse", "machine")
    fields = {key: _take(record, key, str) for key in text}
    return Step(n_frames=_take_count(record, "n_frames", 1, 1 << 40), **fields)


def _segment_file(record: dict[str, Any]) -> SegmentFile:
    name = _take(record, "file", str)
    # A path that led out of the folder, or anywhere but to a segment, ends here.
    if not is_segment_name(name):
        raise ValueError(f"{name!r} is no segment's file name")
    seal = FileSeal(_take_count(record, "size", 8, 1 << 50), _take_digest(record, "sha256"))
    return SegmentFile(name, _take_count(record, "n_frames", 1, 1 << 40), seal)


def _one_line(error: Exception) -> str:
    text = f"no entry {error}" if isinstance(error, KeyError) else str(error)
    return " ".join(text.split())[:200]
