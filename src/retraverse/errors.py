"""The errors users meet, sorted by who can put them right.

Every message says what was wrong, what was got, what was expected and, where it
can be known, the likely cause, in one line. The command line turns `InputError`
and its kin into that line and exit code 2; anything else is our fault (exit 1).
"""

__all__ = [
    "ConfigError",
    "DataMissingError",
    "FrameReadError",
    "InputError",
    "MapError",
    "MissingExtraError",
    "RetraverseError",
    "ShapeError",
]


class RetraverseError(Exception):
    """Root of every error this package raises on purpose."""


class InputError(RetraverseError, ValueError):
    """What the user gave cannot be used as it is."""


class ShapeError(InputError):
    """An array has the wrong number of axes, size or data type."""


class ConfigError(InputError):
    """A parameter is unknown or outside its range."""


class FrameReadError(InputError):
    """A picture cannot be read; the message names the file and the reason."""


class MapError(InputError):
    """A map on disk is truncated, edited, foreign, or made with other parameters."""


class DataMissingError(InputError, FileNotFoundError):
    """A file or folder that should be there is not."""


class MissingExtraError(RetraverseError, ImportError):
    """An optional dependency is needed; the message says which extra installs it."""
