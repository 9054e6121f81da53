"""The network of a technique, ready to be tuned: folded, its inner outputs within reach."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import ConfigError
from retraverse.registry import unknown_name
from retraverse.techniques import technique
from retraverse.techniques.running.learned import LearnedTechnique
from retraverse.training.folding import folded
from retraverse.types import ImageArray

__all__ = ["Outputs", "as_input", "learned_technique", "tunable"]


class Outputs(nn.Module):
    """A network that gives its last output and those of modules inside it.

    Parameters
    ----------
    network : nn.Module
    inner : sequence of str
        Names of modules, such as ``"_blocks.7"``.
    """

    def __init__(self, network: nn.Module, inner: Sequence[str] = ()) -> None:
        super().__init__()
        self.network = network
        self._seen: dict[str, Tensor] = {}
        for name in inner:
            module_named(network, name).register_forward_hook(self._keep(name))
        self._inner = tuple(inner)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Return the inner outputs in order, then the last one."""
        self._seen.clear()
        last = self.network(x)
        return [*(self._seen.pop(name) for name in self._inner), last]

    def _keep(self, name: str) -> Callable[[nn.Module, Any, Any], None]:
        def hook(_module: nn.Module, _inputs: Any, output: Any) -> None:
            self._seen[name] = output

        return hook


def module_named(network: nn.Module, name: str) -> nn.Module:
    """Return a module inside a network; ConfigError if there is none of that name."""
    known = dict(network.named_modules())
    if name not in known:
        raise ConfigError(unknown_name("module of the network", name, sorted(known)[1:]))
    found: nn.Module = known[name]
    return found


def learned_technique(name: str, parameters: dict[str, object]) -> LearnedTechnique:
    """Return a technique that has a PyTorch network.

    Raises
    ------
    ConfigError
        If it has none.
    """
    chosen = technique(name, **parameters)
    if not isinstance(chosen, LearnedTechnique):
        raise ConfigError(f"technique {name} has no network to tune; expected efficientnet or such")
    return chosen


def tunable(network: nn.Module, frozen: Sequence[str] = ()) -> nn.Module:
    """Return a copy that learns: batch normalisation folded, weights with a gradient.

    Parameters
    ----------
    network : nn.Module
    frozen : sequence of str
        Names of modules whose weights stay as they are.

    Raises
    ------
    ConfigError
        If there is no module of such a name.
    """
    copied = folded(network).requires_grad_(True)
    for name in frozen:
        module_named(copied, name).requires_grad_(False)
    for module in copied.modules():
        # What could not be folded keeps its statistics.
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = 0.0
    return copied


def as_input(technique: LearnedTechnique, pictures: Sequence[ImageArray]) -> Tensor:
    """Return pictures as the network takes them, float32 (N, C, H, W), channels last in memory."""
    stacked = torch.from_numpy(np.stack([technique.prepare(picture) for picture in pictures]))
    return stacked.contiguous(memory_format=torch.channels_last)
