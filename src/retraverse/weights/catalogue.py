"""The published weights that techniques here can use: where each lies, and what it must be.

Addresses and checksums are those that the publishers give. Where they give no checksum, the one of
the first download is kept and later ones must equal it. Anything can be fetched from elsewhere
(`retraverse weights get NAME --from URL|FILE`); checksums then still hold.

The table itself is in ``published.py``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal

from retraverse.errors import ConfigError
from retraverse.registry import unknown_name
from retraverse.weights.checksum import Seal

__all__ = ["WeightEntry", "catalogue", "is_catalogued", "weight_entry"]


@dataclass(frozen=True)
class WeightEntry:
    """One published weights file."""

    name: str
    """What users and techniques call it; also the name of the converted file."""
    technique: str
    """The technique that uses it."""
    file_name: str
    """The file as published; for an archive, the archive."""
    addresses: tuple[str, ...]
    """Tried in order. Empty: not a download, see `package`."""
    licence: str
    citation: str
    format: str
    """What is in it: ``caffemodel``, ``matlab``, ``keras``, ``torch``, ``tflite``, ``npz``."""
    n_bytes: int | None = None
    sha256: str | None = None
    sha1: str | None = None
    git_blob: str | None = None
    checksum_of: Literal["file", "member"] = "file"
    """Whether size and checksums are those of the file as published, or of `member` in it."""
    member: str | None = None
    """For an archive: the one file in it that is wanted; ``*`` stands for any text."""
    package: str | None = None
    """The Python package that brings the file, for weights that are no download."""
    note: str = ""

    @property
    def seal(self) -> Seal:
        """What is known of the content that `checksum_of` names."""
        return Seal(self.n_bytes, self.sha256, self.sha1, self.git_blob)

    @property
    def file_seal(self) -> Seal:
        """What the file must be as published."""
        return self.seal if self.checksum_of == "file" else Seal()

    @property
    def member_seal(self) -> Seal:
        """What the file wanted must be, once out of its archive."""
        return self.seal if self.checksum_of == "member" or self.member is None else Seal()


def catalogue() -> list[WeightEntry]:
    """Return every entry, sorted by technique, then by name."""
    return sorted(_by_name().values(), key=lambda entry: (entry.technique, entry.name))


def is_catalogued(name: str) -> bool:
    """Tell whether there is an entry of that name."""
    return name in _by_name()


def weight_entry(name: str) -> WeightEntry:
    """Return one entry.

    Raises
    ------
    ConfigError
        If there is none of that name; names the nearest.

    Examples
    --------
    >>> weight_entry("alexnet").n_bytes
    243862414
    """
    if name not in _by_name():
        raise ConfigError(unknown_name("weights", name, sorted(_by_name())))
    return _by_name()[name]


@cache
def _by_name() -> Mapping[str, WeightEntry]:
    from retraverse.weights.published import PUBLISHED

    return {entry.name: entry for entry in PUBLISHED}
