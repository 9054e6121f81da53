"""Filling a network with an official checkpoint: every tensor used, none invented.

A checkpoint of a larger network of the same family holds all that a smaller one needs, so what is
left over is refused too.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
import torch
from torch import nn

from retraverse.errors import InputError
from retraverse.techniques.networks.loading import load_checked

__all__ = ["load_published", "rename", "unfilled"]

Network = TypeVar("Network", bound=nn.Module)

_COUNTER = "num_batches_tracked"
"""What BatchNorm counts while training: without meaning here, and missing in some files."""


def unfilled(make: Callable[[], Network]) -> Network:
    """Return a network without values, for `load_published` to fill.

    Drawing random ones first, only to replace them, takes a large network most of a second.
    """
    with torch.device("meta"):
        return make()


def rename(name: str, renames: Iterable[tuple[str, str]]) -> str:
    """Return a name with the first start of `renames` that fits it exchanged.

    Examples
    --------
    >>> rename("backbone.0.weight", [("backbone.0.", "backbone.conv1.")])
    'backbone.conv1.weight'
    """
    for published, ours in renames:
        if name.startswith(published):
            return ours + name.removeprefix(published)
    return name


def load_published(
    network: nn.Module,
    tensors: Mapping[str, Any],
    owner: str,
    *,
    renames: Iterable[tuple[str, str]] = (),
    unused: Iterable[str] = (),
) -> None:
    """Fill a network with a checkpoint under its published names.

    Parameters
    ----------
    network : nn.Module
        May be `unfilled`.
    tensors : mapping from published names to arrays
    owner : str
        The technique's name, for messages.
    renames : pairs of str
        A name's start as published, and as here; the first that fits is taken.
    unused : str
        Regular expressions of whole names, as here, that the network has no use for.

    Raises
    ------
    InputError
        If a tensor is missing, left over, or of another shape.
    """
    pairs = list(renames)
    named = {rename(name, pairs): array for name, array in tensors.items()}
    own = network.state_dict()
    allowed = re.compile("|".join([*unused, rf".*\.{_COUNTER}"]))
    left = [name for name in named if name not in own and not allowed.fullmatch(name)]
    if left:
        raise InputError(
            f"weights of {owner}: {len(left)} tensors too many, such as {left[0]!r}; "
            "weights of another network, or of another size of it?"
        )
    if any(value.is_meta for value in own.values()):
        network.to_empty(device="cpu")
    counters = {name: np.zeros((), np.int64) for name in own if name.endswith(_COUNTER)}
    load_checked(network, {**counters, **named}, owner)
