"""Where a map came from: technique, sources, versions, machine, and what the pictures were."""

import os
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from retraverse._version import __version__
from retraverse.errors import DataMissingError, MapError
from retraverse.techniques import FingerprintedTechnique, Layout, Technique, technique
from retraverse.techniques.parameters import uncompared_parameters

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
    fingerprint: str = ""
    """SHA-256 of what the parameters only name, such as trained weights; "" where there is none."""

    @classmethod
    def of(cls, technique: Technique, *, missing: str | None = None) -> "TechniqueRecord":
        """Return the record of a technique.

        Parameters
        ----------
        technique : Technique
        missing : str, optional
            Which fingerprint to take where its weights are not there. Default: none is taken.

        Raises
        ------
        DataMissingError
            If its weights are not there, and no `missing` is given.
        """
        return cls(
            name=technique.name,
            version=technique.version,
            parameters=asdict(technique.parameters),
            layout=_layout_json(technique.layout),
            fingerprint=_fingerprint(technique, missing),
        )

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> "TechniqueRecord":
        """Return the record as a manifest says it; `ValueError` and kin if it cannot be one."""
        name, version = record["name"], record["version"]
        parameters, layout = record["parameters"], record["layout"]
        fingerprint = record.get("fingerprint", "")
        values = (name, version, parameters, layout, fingerprint)
        for value, kind in zip(values, (str, int, dict, dict, str), strict=True):
            if type(value) is not kind:
                raise TypeError(f"the technique has a {type(value).__name__} for {kind.__name__}")
        if not "".join([name, *parameters]).isprintable():
            raise ValueError("the technique's name or a parameter's is not printable")
        if fingerprint and not re.fullmatch("[0-9a-f]{64}", fingerprint, re.ASCII):
            raise ValueError("the technique's fingerprint is no SHA-256 checksum")
        return cls(name, version, parameters, layout, fingerprint)

    def to_json(self) -> dict[str, Any]:
        """Return the record as JSON has it."""
        return {
            "name": self.name,
            "version": self.version,
            "parameters": dict(self.parameters),
            "layout": dict(self.layout),
            # Only where there is one: other maps stay, byte for byte, as they always were.
            **({"fingerprint": self.fingerprint} if self.fingerprint else {}),
        }

    def __str__(self) -> str:
        parameters = ", ".join(f"{name}={value!r}" for name, value in self.parameters.items())
        return f"{self.name}({parameters}) version {self.version}"

    def restore(self, what: str) -> Technique:
        """Return the technique this records, from the registry.

        Weights that are not there are no obstacle: a map can be looked at without, and its
        technique says what is missing once it is to describe a picture.

        Raises
        ------
        MapError
            If this program has no such technique, parameter, or version of it, or other weights.
        """
        try:
            restored = technique(self.name, **self.parameters)
        except (ValueError, TypeError, ArithmeticError) as error:
            raise MapError(
                f"{what}: made with {self}, which this program lacks: {error}"
            ) from error
        record = TechniqueRecord.of(restored, missing=self.fingerprint)
        self._require(record, uncompared_parameters(restored.parameters), what, "this program has")
        return restored

    def require(self, technique: Technique, what: str) -> None:
        """Refuse a technique whose descriptions could not be compared with this one's.

        Raises
        ------
        MapError
            Naming both.
        DataMissingError
            If its weights are not there.
        """
        free = uncompared_parameters(technique.parameters)
        self._require(TechniqueRecord.of(technique), free, what, "you asked for")

    def _require(
        self, other: "TechniqueRecord", free: frozenset[str], what: str, asked: str
    ) -> None:
        if other._compared(free) == self._compared(free):
            return
        if self.fingerprint != other.fingerprint and self.name == other.name:
            raise MapError(
                f"{what}: made with {self} and weights of SHA-256 {self.fingerprint[:12]}…, "
                f"{asked} {other} and weights of SHA-256 {other.fingerprint[:12]}…; "
                "use those weights, or build the map again"
            )
        if str(other) == str(self):
            raise MapError(
                f"{what}: made with {self}, but its arrays are {dict(self.layout)}, "
                f"expected {dict(other.layout)}; build the map again"
            )
        raise MapError(f"{what}: made with {self}, {asked} {other}; build the map again")

    def _compared(self, free: frozenset[str]) -> "TechniqueRecord":
        """Return the record without the parameters that do not change descriptors."""
        kept = {name: value for name, value in self.parameters.items() if name not in free}
        return replace(self, parameters=kept)


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


def _fingerprint(technique: Technique, missing: str | None) -> str:
    if not isinstance(technique, FingerprintedTechnique):
        return ""
    try:
        return technique.fingerprint()
    except DataMissingError:
        if missing is None:
            raise
        return missing


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
