"""Fetching catalogued weights into the store."""

from pathlib import Path

from retraverse.types import Progress, no_progress
from retraverse.weights.catalogue import WeightEntry, weight_entry
from retraverse.weights.checksum import Seal
from retraverse.weights.download import DownloadError, fetch, plan_download
from retraverse.weights.records import stored_weights, weights_folder
from retraverse.weights.store import find_weights, import_weights

__all__ = ["get_weights"]


def get_weights(
    name: str,
    *,
    source: str | None = None,
    accept_changed: bool = False,
    progress: Progress = no_progress,
) -> Path:
    """Fetch catalogued weights and convert them into the store.

    Parameters
    ----------
    name : str
        An entry of the catalogue.
    source : str, optional
        Another address, or a file on this machine. Default: the catalogue's addresses in turn.
    accept_changed : bool
        Whether a file with another checksum than the catalogue's or the first download's is
        taken: the publisher may have replaced it.
    progress : Progress
        Watches the download, in steps of about a megabyte.

    Returns
    -------
    path : Path
        The converted file.

    Raises
    ------
    ConfigError
        If there is no entry of that name.
    DownloadError
        If no address gives it. What came stays; asking again carries on.
    InputError
        If the file is not what it must be.
    """
    entry = weight_entry(name)
    if source is None and entry.package is not None:
        return find_weights(name)
    if source is not None and "://" not in source:
        return import_weights(source, name=name, accept_changed=accept_changed)
    downloads = weights_folder() / "downloads"
    target = downloads / entry.file_name
    addresses = (source,) if source is not None else entry.addresses
    expected = Seal() if accept_changed else _expected_file(entry)
    address = _fetch_any(entry, addresses, target, expected, progress)
    path = import_weights(target, name=name, source=address, accept_changed=accept_changed)
    # Only now: a file that cannot be converted need not be fetched again.
    target.unlink()
    return path


def _expected_file(entry: WeightEntry) -> Seal:
    """Return what the download must be: the catalogue's seal, else the pin, if of the same file."""
    record = stored_weights(entry.name)
    if entry.file_seal.has_checksum or record is None or entry.member is not None:
        return entry.file_seal
    return record.published


def _fetch_any(
    entry: WeightEntry,
    addresses: tuple[str, ...],
    target: Path,
    expected: Seal,
    progress: Progress,
) -> str:
    """Fetch from the first address that gives the file; return which."""
    problems = []
    for address in addresses:
        try:
            fetch(plan_download(address, target, expected), progress)
            return address
        except DownloadError as error:
            problems.append(str(error))
    raise DownloadError(
        f"weights {entry.name!r}: {'; '.join(problems)}; or bring {entry.file_name} here and run "
        f"`retraverse weights import {entry.file_name} --name {entry.name}`"
    )
