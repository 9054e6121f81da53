"""Quantisation tables: how coarsely JPEG stores each of the 64 frequencies of an 8 x 8 block.

Conventions
- A table is 64 steps in rows: step 0 is the block's mean, step ``8 * v + u`` the cosine that
  turns u half waves across and v half waves down. A larger step is coarser.
- A `QuantisationTables` is what an encoder holds at quality 50; other qualities scale it by
  libjpeg's rule (`scaled_table`), so that a tuned pair serves every compression.

References
----------
ITU-T Recommendation T.81 (1992), annex K.1; the scaling rule is the Independent JPEG Group's.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from retraverse.errors import ConfigError

__all__ = ["STANDARD_TABLES", "QuantisationTables", "scaled_table"]

N_STEPS = 64
LARGEST_STEP = 255
"""Of a baseline table, which stores a step in one byte."""

Table = tuple[int, ...]


@dataclass(frozen=True)
class QuantisationTables:
    """The steps of luminance and chrominance at quality 50."""

    luminance: Table
    """64 whole numbers, 1 to 32767, in rows."""
    chrominance: Table
    """The same for both colour planes."""
    name: str = "custom"
    """For records: which technique and set they were tuned for, say."""

    def __post_init__(self) -> None:
        """Check lengths and ranges."""
        for plane, steps in (("luminance", self.luminance), ("chrominance", self.chrominance)):
            if len(steps) != N_STEPS:
                raise ConfigError(f"{plane} table: got {len(steps)} steps, expected {N_STEPS}")
            if any(step != int(step) or not 1 <= step <= 32767 for step in steps):
                raise ConfigError(f"{plane} table: expected whole steps from 1 to 32767")
        object.__setattr__(self, "luminance", tuple(int(step) for step in self.luminance))
        object.__setattr__(self, "chrominance", tuple(int(step) for step in self.chrominance))

    @property
    def label(self) -> str:
        """Name and fingerprint, for records: ``"standard-8b5a3c0f91d2"``."""
        steps = ",".join(map(str, self.luminance + self.chrominance))
        return f"{self.name}-{hashlib.sha256(steps.encode()).hexdigest()[:12]}"

    def at_quality(self, quality: int) -> tuple[Table, Table]:
        """Return luminance and chrominance as a file of this quality holds them."""
        return scaled_table(self.luminance, quality), scaled_table(self.chrominance, quality)


def scaled_table(steps: Sequence[int], quality: int) -> Table:
    """Return the steps of a table at a JPEG quality, by libjpeg's rule, each from 1 to 255.

    Parameters
    ----------
    steps : sequence of 64 int
        The table at quality 50.
    quality : int in [1, 100]
        At 100 every step is 1; below 50 the steps grow as 50 / quality.

    Raises
    ------
    ConfigError
        If the quality is outside its range.
    """
    if not 1 <= quality <= 100:
        raise ConfigError(f"JPEG quality: got {quality}, expected 1 to 100")
    percent = 5000 // quality if quality < 50 else 200 - 2 * quality
    return tuple(min(LARGEST_STEP, max(1, (step * percent + 50) // 100)) for step in steps)


# T.81 tables K.1 and K.2, which libjpeg takes for quality 50.
_LUMINANCE = """
    16  11  10  16  24  40  51  61
    12  12  14  19  26  58  60  55
    14  13  16  24  40  57  69  56
    14  17  22  29  51  87  80  62
    18  22  37  56  68 109 103  77
    24  35  55  64  81 104 113  92
    49  64  78  87 103 121 120 101
    72  92  95  98 112 100 103  99
"""
_CHROMINANCE_CORNER = """
    17  18  24  47
    18  21  26  66
    24  26  56  99
    47  66  99  99
"""


def _standard_chrominance() -> Table:
    corner = [int(text) for text in _CHROMINANCE_CORNER.split()]
    return tuple(
        corner[4 * row + column] if row < 4 and column < 4 else 99
        for row in range(8)
        for column in range(8)
    )


STANDARD_TABLES = QuantisationTables(
    tuple(int(text) for text in _LUMINANCE.split()), _standard_chrominance(), "standard"
)
"""The tables every encoder takes unless told otherwise (T.81, tables K.1 and K.2)."""
