"""Optional dependencies: imported when needed, and a clear word where they are not there."""

import importlib
from types import ModuleType

from retraverse.errors import MissingExtraError

__all__ = ["import_extra"]


def import_extra(module: str, extra: str) -> ModuleType:
    """Return an optional module.

    Parameters
    ----------
    module : str
        What is imported: ``"torch"``.
    extra : str
        The extra of this package that installs it: ``"learned"``.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{module} is needed here and cannot be imported ({error}); "
            f"install it with: pip install 'retraverse[{extra}]'"
        ) from error
