"""What a download is to be: decided here, without touching network or disk."""

import urllib.parse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from retraverse.errors import InputError
from retraverse.weights.checksum import Seal

__all__ = ["DownloadError", "DownloadPlan", "plan_download"]


class DownloadError(InputError):
    """A file cannot be fetched: no network, not there, or not what it should be."""


@dataclass(frozen=True)
class DownloadPlan:
    """What will be fetched, from where, and where it goes."""

    address: str
    target: Path
    expected: Seal
    attempts: int = 5
    """How often a connection may be cut without any byte having come."""
    pause_s: float = 1.0
    """Before the second attempt; doubles each time."""
    timeout_s: float = 30.0
    """Silence after which a connection counts as cut."""

    @property
    def part(self) -> Path:
        """Where the bytes gather."""
        return self.target.with_name(self.target.name + ".part")

    @property
    def record(self) -> Path:
        """What is known of the bytes in `part`: address and version."""
        return self.target.with_name(self.target.name + ".part.json")


def plan_download(
    address: str, target: Path, expected: Seal | None = None, **settings: Any
) -> DownloadPlan:
    """Return the plan of a download.

    Parameters
    ----------
    address : str
        ``http://`` or ``https://``.
    target : Path
        Where the file will be.
    expected : Seal, optional
        What it must be.
    **settings
        Other fields of `DownloadPlan`.

    Raises
    ------
    DownloadError
        If the address is of another kind.
    """
    parts = urllib.parse.urlsplit(address)
    if parts.scheme not in ("http", "https") or not parts.netloc:
        raise DownloadError(f"address: got {address!r}, expected http://… or https://…")
    return DownloadPlan(address, target, expected or Seal(), **settings)
