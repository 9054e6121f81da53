"""Filling a network with named tensors, and what is said where they do not fit."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import nn

from retraverse.errors import InputError

__all__ = ["load_checked", "tensor_named"]


def load_checked(network: nn.Module, tensors: Mapping[str, Any], owner: str) -> None:
    """Fill every parameter and buffer of a network; tensors it has no use for are left out.

    Parameters
    ----------
    network : nn.Module
    tensors : mapping from the network's own names to arrays
        Axes of length 1 may be more or fewer than the network's.
    owner : str
        The network's name, for messages.

    Raises
    ------
    InputError
        If a tensor is missing, or has another shape: weights of another network.
    """
    chosen = {}
    for name, value in network.state_dict().items():
        tensor = torch.as_tensor(tensor_named(tensors, name, owner)).to(value.dtype)
        if _essential(tensor.shape) != _essential(value.shape):
            raise InputError(
                f"weights of {owner}: {name!r} has shape {tuple(tensor.shape)}, "
                f"expected {tuple(value.shape)}; weights of another network?"
            )
        chosen[name] = tensor.reshape(value.shape)
    network.load_state_dict(chosen)


def tensor_named(tensors: Mapping[str, Any], name: str, owner: str) -> Any:
    """Return one tensor; InputError if there is none of that name."""
    if name not in tensors:
        raise InputError(
            f"weights of {owner}: no {name!r} among {len(tensors)} tensors; "
            "weights of another network?"
        )
    return tensors[name]


def _essential(shape: torch.Size) -> tuple[int, ...]:
    return tuple(length for length in shape if length != 1)
