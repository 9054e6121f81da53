"""Pretrained weights: where they are, how they come here, and readers of every format they have.

Nothing here needs PyTorch, Caffe, TensorFlow or MATLAB, and nothing in a weights file is executed.
The names below are imported when first used: what only asks the catalogue loads no network code.
The catalogue as a list is ``retraverse.weights.catalogue.catalogue()``.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from retraverse.weights.catalogue import WeightEntry, weight_entry
    from retraverse.weights.checksum import Seal
    from retraverse.weights.download import DownloadError
    from retraverse.weights.get import get_weights
    from retraverse.weights.records import (
        StoredWeights,
        names_in_store,
        stored_weights,
        weights_folder,
    )
    from retraverse.weights.store import find_weights, import_weights, load_tensors
    from retraverse.weights.verify import Verdict, verify_weights
    from retraverse.weights.weight_file import WeightFile

__all__ = [
    "DownloadError",
    "Seal",
    "StoredWeights",
    "Verdict",
    "WeightEntry",
    "WeightFile",
    "find_weights",
    "get_weights",
    "import_weights",
    "load_tensors",
    "names_in_store",
    "stored_weights",
    "verify_weights",
    "weight_entry",
    "weights_folder",
]

_MODULES = {
    "catalogue": ("WeightEntry", "weight_entry"),
    "checksum": ("Seal",),
    "download": ("DownloadError",),
    "get": ("get_weights",),
    "records": ("StoredWeights", "names_in_store", "stored_weights", "weights_folder"),
    "store": ("find_weights", "import_weights", "load_tensors"),
    "verify": ("Verdict", "verify_weights"),
    "weight_file": ("WeightFile",),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name from its module when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module 'retraverse.weights' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"retraverse.weights.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
