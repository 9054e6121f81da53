"""Array aliases and small protocols that every room shares."""

from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "BoolArray", "FloatArray", "ImageArray", "IntArray", "Progress", "no_progress"]

Item = TypeVar("Item")

Array = NDArray[Any]
"""Any array."""
FloatArray = NDArray[np.float32]
"""Scores, descriptors: float32."""
IntArray = NDArray[np.int64]
"""Frame numbers: int64, from 0, -1 = none."""
BoolArray = NDArray[np.bool_]
ImageArray = NDArray[np.uint8]
"""Pixels: uint8, (height, width) grey or (height, width, 3) RGB."""


class Progress(Protocol):
    """Wraps an iterable and shows how far it has come; see `no_progress`."""

    def __call__(self, items: Iterable[Item], *, total: int, label: str) -> Iterable[Item]:
        """Return `items`, of which there are `total`; `label` says what is going on."""
        ...


def no_progress(items: Iterable[Item], *, total: int, label: str) -> Iterable[Item]:
    """Return `items` unchanged: the progress of those who do not watch."""
    return items
