"""Where a map came from: technique, sources, versions, machine, and what the pictures were."""

import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from retraverse._version import __version__
from retraverse.errors import MapError
from retraverse.techniques import Layout, Technique, technique

__all__ = ["Provenance", "Step", "TechniqueRecord"]


@dataclass(frozen=True)
class Step:
    """One building or extending of a map."""

    action: str
    """``"build"`` or ``"extend"``."""
    source: str
    """What the traverse says it was read from."""
    n_frames: int
    """Frames that this step added."""
    created_at: str
    """UTC, ISO 8601: ``"2026-11-22T02:11:05+00:00"``."""
    retraverse: str
    """Version of this package."""
    machine: str
    """Operating system, processor, Python, NumPy; not the machine's name."""

    @classmethod
    def now(cls, action: str, source: str, n_frames: int) -> "Step":
        """Return a step made here and now."""
        created_at = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(action, source, n_frames, created_at, __version__, _machine())


@dataclass(frozen=True)
class TechniqueRecord:
    """What must be equal for descriptions to be comparable."""

    name: str
    version: int
    parameters: Mapping[str, Any]
    """Every field of the technique's parameter dataclass."""
    layout: Mapping[str, Any]
    """``kind``, and for every array its shape and dtype."""

    @classmethod
    def of(cls, technique: Technique) -> "TechniqueRecord":
        """Return the record of a technique."""
        parameters = asdict(technique.parameters)
        return cls(technique.name, technique.version, parameters, _layout_json(technique.layout))

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> "TechniqueRecord":
        """Return the record as a manifest says it; `ValueError` and kin if it cannot be one."""
        name, version = record["name"], record["version"]
        parameters, layout = record["parameters"], record["layout"]
        kinds = (str, int, dict, dict)
        for value, kind in zip((name, version, parameters, layout), kinds, strict=True):
            if type(value) is not kind:
                raise TypeError(f"the technique has a {type(value).__name__} for {kind.__name__}")
        if not "".join([name, *parameters]).isprintable():
            raise ValueError("the technique's name or a parameter's is not printable")
        return cls(name, version, parameters, layout)

    def to_json(self) -> dict[str, Any]:
        """Return the record as JSON has it."""
        return {
            "name": self.name,
            "version": self.version,
            "parameters": dict(self.parameters),
            "layout": dict(self.layout),
        }

    def __str__(self) -> str:
        parameters = ", ".join(f"{name}={value!r}" for name, value in self.parameters.items())
        return f"{self.name}({parameters}) version {self.version}"

    def restore(self, what: str) -> Technique:
        """Return the technique this records, from the registry.

        Raises
        ------
        MapError
            If this program has no such technique, parameter, or version of it.
        """
        try:
            restored = technique(self.name, **self.parameters)
        except (ValueError, TypeError, ArithmeticError) as error:
            raise MapError(
                f"{what}: made with {self}, which this program lacks: {error}"
            ) from error
        self.require(restored, what, asked="this program has")
        return restored

    def require(self, technique: Technique, what: str, *, asked: str = "you asked for") -> None:
        """Refuse a technique whose descriptions could not be compared with this one's.

        Raises
        ------
        MapError
            Naming both.
        """
        other = TechniqueRecord.of(technique)
        if other == self:
            return
        if str(other) == str(self):
            raise MapError(
                f"{what}: made with {self}, but its arrays are {dict(self.layout)}, "
                f"expected {dict(other.layout)}; build the map again"
            )
        raise MapError(f"{what}: made with {self}, {asked} {other}; build the map again")


@dataclass(frozen=True)
class Provenance:
    """Where a map came from."""

    technique: TechniqueRecord
    history: tuple[Step, ...]
    """How it was built, then how it was extended."""
    content_sha256: str
    """SHA-256 of all names and pictures in route order, as `Traverse.content_hash` makes it."""

    @property
    def created_at(self) -> str:
        """When the map was first built; UTC, ISO 8601."""
        return self.history[0].created_at

    @property
    def source(self) -> str:
        """What was read, in order."""
        return " + ".join(step.source for step in self.history)


def _layout_json(layout: Layout) -> dict[str, Any]:
    arrays = {
        name: {"shape": [int(n) for n in spec.shape], "dtype": np.dtype(spec.dtype).name}
        for name, spec in layout.arrays.items()
    }
    return {"kind": layout.kind, "arrays": arrays}


@cache
def _machine() -> str:
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}, NumPy {np.__version__}"
    )
