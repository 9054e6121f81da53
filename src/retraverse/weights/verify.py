"""Whether the weights on this machine are still what came."""

from dataclasses import dataclass

from retraverse.errors import DataMissingError
from retraverse.types import Progress, no_progress
from retraverse.weights.catalogue import is_catalogued, weight_entry
from retraverse.weights.checksum import describe_mismatch, seal_file
from retraverse.weights.records import (
    converted_path,
    names_in_store,
    stored_weights,
    weights_folder,
)

__all__ = ["Verdict", "verify_weights"]


@dataclass(frozen=True)
class Verdict:
    """What verifying one entry of the store found."""

    name: str
    state: str
    """``ok``, ``changed``, ``missing`` (a record without its file) or ``unknown`` (no record)."""
    detail: str = ""


def verify_weights(
    names: list[str] | None = None, *, progress: Progress = no_progress
) -> list[Verdict]:
    """Compute the checksums of what is in the store again and compare.

    Parameters
    ----------
    names : list of str, optional
        Default: everything in the store.
    progress : Progress
        Watches the entries.

    Raises
    ------
    DataMissingError
        If one of `names` is not in the store.
    """
    here = names_in_store()
    for name in names or []:
        if name not in here:
            raise DataMissingError(f"weights verify: {name!r} is not in {weights_folder()}")
    wanted = names or here
    return [
        _verdict(name) for name in progress(wanted, total=len(wanted), label="verifying weights")
    ]


def _verdict(name: str) -> Verdict:
    path, record = converted_path(name), stored_weights(name)
    if not path.is_file():
        return Verdict(name, "missing", f"run `retraverse weights get {name}`")
    if record is None:
        return Verdict(name, "unknown", "no readable record beside it; import it again")
    problem = describe_mismatch(seal_file(path), record.converted)
    if problem is None and is_catalogued(name):
        problem = describe_mismatch(record.published, weight_entry(name).member_seal)
    return Verdict(name, "changed", problem) if problem else Verdict(name, "ok")
