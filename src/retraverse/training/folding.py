"""Batch normalisation folded into the convolutions before it, so that tuning is fast and stable.

Tuning with few pictures wants the statistics of batch normalisation as they are; then each is
only a scale and a shift, which the convolution before it can hold. `folded` gives a network that
computes the same with half the passes over memory; `unfolded_state` gives its weights back under
the names of the original, which any program that knows the network can load.

The gradient of a convolution by channels (depthwise) is computed in float32: in bfloat16 it takes
five times as long on processors of today.
"""

import copy
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.techniques.networks.efficientnet_lite import SameConv2d

__all__ = ["FoldedConv", "folded", "unfolded_state"]


class FoldedConv(nn.Module):
    """A convolution that also does what the batch normalisation after it did.

    Parameters
    ----------
    convolution : nn.Conv2d
        Zeros around the picture; no dilation.
    norm : nn.BatchNorm2d
        Its statistics are taken as they are.
    """

    def __init__(self, convolution: nn.Conv2d, norm: nn.BatchNorm2d) -> None:
        super().__init__()
        mean, variance = norm.running_mean, norm.running_var
        assert mean is not None
        assert variance is not None
        scale = norm.weight / torch.sqrt(variance + norm.eps)
        shift = norm.bias - mean * scale
        if convolution.bias is not None:
            shift = shift + convolution.bias * scale
        weight = convolution.weight * scale[:, None, None, None]
        self.weight = nn.Parameter(
            weight.detach().clone().contiguous(memory_format=torch.channels_last)
        )
        self.bias = nn.Parameter(shift.detach().clone())
        self.stride = int(convolution.stride[0])
        self.groups = convolution.groups
        self.by_channel = self.groups == len(self.weight) and self.weight.shape[1] == 1
        self.same = isinstance(convolution, SameConv2d)
        self.padding = 0 if self.same else int(convolution.padding[0])

    def forward(self, x: Tensor) -> Tensor:
        """Return the convolution of (N, C, H, W), normalised."""
        if not self.same:
            return self._convolve(x, self.padding)
        before = [self._total(size) // 2 for size in x.shape[2:]]
        after = [self._total(size) - self._total(size) // 2 for size in x.shape[2:]]
        if before == after:
            return self._convolve(x, before[0]) if before[0] == before[1] else self._padded(x)
        if before[0] != before[1] or self.stride != 2:
            return self._padded(x)
        # One more row and column on all sides, of which the first results are left out, costs
        # less than copying the input into a larger one: stride 2 skips what was added.
        height, width = (-(-size // 2) for size in x.shape[2:])
        return self._convolve(x, before[0] + 2)[:, :, 1 : height + 1, 1 : width + 1]

    def _padded(self, x: Tensor) -> Tensor:
        """Return the convolution of the input inside zeros, as many as each side wants."""
        (top, bottom), (left, right) = (
            (self._total(size) // 2, self._total(size) - self._total(size) // 2)
            for size in x.shape[2:]
        )
        return self._convolve(functional.pad(x, (left, right, top, bottom)), 0)

    def _total(self, size: int) -> int:
        kernel = self.weight.shape[2]
        return max((-(-size // self.stride) - 1) * self.stride + kernel - size, 0)

    def _convolve(self, x: Tensor, padding: int) -> Tensor:
        if self.by_channel and torch.is_autocast_enabled("cpu") and torch.is_grad_enabled():
            with torch.autocast("cpu", enabled=False):
                result = _Depthwise.apply(  # type: ignore[no-untyped-call]
                    x, self.weight, self.bias, self.stride, padding
                )
                assert isinstance(result, Tensor)
                return result
        return functional.conv2d(x, self.weight, self.bias, self.stride, padding, 1, self.groups)


class _Depthwise(torch.autograd.Function):
    """Forward in the input's own precision, backward in float32."""

    @staticmethod
    def forward(
        ctx: Any, x: Tensor, weight: Tensor, bias: Tensor, stride: int, padding: int
    ) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.geometry = stride, padding
        return functional.conv2d(
            x, weight.to(x.dtype), bias.to(x.dtype), stride, padding, 1, len(weight)
        )

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        x, weight = ctx.saved_tensors
        stride, padding = ctx.geometry
        wanted = [bool(needed) for needed in ctx.needs_input_grad[:3]]
        of_x, of_weight, of_bias = torch.ops.aten.convolution_backward(
            gradient.float(), x.float(), weight, [len(weight)], [stride, stride],
            [padding, padding], [1, 1], False, [0, 0], len(weight), wanted,
        )  # fmt: skip
        return (None if of_x is None else of_x.to(x.dtype), of_weight, of_bias, None, None)


def folded(network: nn.Module) -> nn.Module:
    """Return a copy in which every convolution holds the batch normalisation after it.

    Parameters
    ----------
    network : nn.Module
        A batch normalisation belongs to the convolution that its parent module lists before it,
        and nothing may come between them; without any, the copy is only a copy.
    """
    copied = copy.deepcopy(network).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    for parent, convolution_name, norm_name in list(_pairs(copied)):
        convolution, norm = getattr(parent, convolution_name), getattr(parent, norm_name)
        setattr(parent, convolution_name, FoldedConv(convolution, norm))
        setattr(parent, norm_name, nn.Identity())
    assert isinstance(copied, nn.Module)
    return copied


def unfolded_state(trained: nn.Module, original: nn.Module) -> dict[str, Tensor]:
    """Return the weights of a folded network under the names of the network it was made of.

    Each batch normalisation becomes a shift alone: mean 0, scale 1 (weight = square root of the
    variance it keeps), so `original` with these weights computes what `trained` does.
    """
    unfolded = copy.deepcopy(original)
    with torch.no_grad():
        for parent, convolution_name, norm_name in list(_pairs(unfolded)):
            ours = trained.get_submodule(_path(unfolded, parent, convolution_name))
            convolution, norm = getattr(parent, convolution_name), getattr(parent, norm_name)
            convolution.weight.copy_(ours.weight)
            if convolution.bias is not None:
                convolution.bias.zero_()
            norm.weight.copy_(torch.sqrt(norm.running_var + norm.eps))
            norm.running_mean.zero_()
            norm.bias.copy_(ours.bias)
    state = unfolded.state_dict()
    own = trained.state_dict()
    folded_names = {name.rpartition(".")[0] for name in _folded_names(original)}
    for name in state:
        if name.rpartition(".")[0] not in folded_names:
            state[name] = own[name]
    return {name: value.detach().contiguous() for name, value in state.items()}


def _pairs(network: nn.Module) -> Iterator[tuple[nn.Module, str, str]]:
    """Yield (parent, name of convolution, name of the batch normalisation after it)."""
    for parent in network.modules():
        children = list(parent.named_children())
        for (first, convolution), (second, norm) in pairwise(children):
            if isinstance(convolution, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
                yield parent, first, second


def _folded_names(network: nn.Module) -> Iterator[str]:
    for parent, convolution, norm in _pairs(network):
        yield f"{_path(network, parent, convolution)}.weight"
        yield f"{_path(network, parent, norm)}.weight"


def _path(network: nn.Module, parent: nn.Module, child: str) -> str:
    prefix = next(name for name, module in network.named_modules() if module is parent)
    return f"{prefix}.{child}" if prefix else child
