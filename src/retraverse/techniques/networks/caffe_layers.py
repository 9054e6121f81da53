"""Caffe's layers as torch modules: one builder a kind, with Caffe's own rules.

Where Caffe and torch differ, and what is done: pooling rounds sizes up (``ceil_mode``), and means
count the zeros of the padding but not what lies beyond it, which torch does the same way; response
normalisation takes the mean over its window as torch does; BatchNorm's stored sums are divided by
its third blob.

Source: BVLC Caffe, ``caffe.proto`` for settings and their defaults; its layer catalogue.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import InputError
from retraverse.weights.caffe_graph import CaffeLayer

__all__ = ["Built", "Shape", "build_layer", "known_kinds"]

Shape = tuple[int, ...]


class Built(NamedTuple):
    """A layer without values: its parameters have shapes (device ``meta``) and no memory."""

    module: nn.Module
    blobs: tuple[str, ...]
    """The module's parameters or buffers in the order of Caffe's blobs."""


def build_layer(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    """Return the module of a layer that reads blobs of the given shapes.

    Raises
    ------
    InputError
        If the layer's kind is not known or its settings do not fit.
    """
    builder = _builders.get(layer.kind)
    if builder is None:
        raise InputError(
            f"layer {layer.name!r} is of kind {layer.kind!r}, expected one of {known_kinds()}"
        )
    if not shapes:
        raise InputError(f"layer {layer.name!r} ({layer.kind}) reads no blob")
    with torch.device("meta"):
        return builder(layer, shapes)


def known_kinds() -> list[str]:
    """Return the kinds of layers there are builders for, sorted."""
    return sorted(_builders)


def _pair(layer: CaffeLayer, block: str, name: str, default: int) -> tuple[int, int]:
    """Return height and width of a setting that has one value for both, two, or ``_h``, ``_w``."""
    short = name.removesuffix("_size")
    both = layer.values(f"{block}.{name}") or (default,)
    height, width = (both[0], both[-1]) if len(both) <= 2 else (-1, -1)
    height = layer.integer(f"{block}.{short}_h", height if type(height) is int else -1)
    width = layer.integer(f"{block}.{short}_w", width if type(width) is int else -1)
    lowest = 0 if short == "pad" else 1
    if not lowest <= min(height, width) <= max(height, width) < 1 << 16:
        raise InputError(f"layer {layer.name!r}: {name} is {both}, expected {lowest} or more")
    return height, width


def _outputs(layer: CaffeLayer, block: str) -> int:
    count = layer.integer(f"{block}.num_output", 0)
    if not 0 < count < 1 << 24:
        raise InputError(f"layer {layer.name!r}: num_output is {count}, expected 1 or more")
    return count


def _convolution(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    block = "convolution_param"
    groups, bias = layer.integer(f"{block}.group", 1), layer.flag(f"{block}.bias_term", True)
    if len(shapes[0]) != 4 or groups < 1 or shapes[0][1] % groups:
        raise InputError(f"layer {layer.name!r}: {groups} groups for an input of {shapes[0]}")
    module = nn.Conv2d(
        shapes[0][1],
        _outputs(layer, block),
        _pair(layer, block, "kernel_size", 0),
        stride=_pair(layer, block, "stride", 1),
        padding=_pair(layer, block, "pad", 0),
        dilation=_pair(layer, block, "dilation", 1),
        groups=groups,
        bias=bias,
    )
    return Built(module, ("weight", "bias")[: 1 + bias])


class _Pooling(nn.Module):
    def __init__(
        self, method: str, window: tuple[int, int], stride: tuple[int, int], pad: tuple[int, int]
    ) -> None:
        super().__init__()
        self.method, self.window, self.stride, self.pad = method, window, stride, pad
        self.round_up = True

    def forward(self, values: Tensor) -> Tensor:
        pool = functional.max_pool2d if self.method == "MAX" else functional.avg_pool2d
        return pool(values, self.window, self.stride, self.pad, ceil_mode=self.round_up)


class _GlobalPooling(nn.Module):
    def __init__(self, method: str) -> None:
        super().__init__()
        self.method = method

    def forward(self, values: Tensor) -> Tensor:
        if self.method == "MAX":
            return values.amax((2, 3), keepdim=True)
        return values.mean((2, 3), keepdim=True)


def _pooling(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    block = "pooling_param"
    method = {"0": "MAX", "1": "AVE"}.get(layer.word(f"{block}.pool", "MAX"), "")
    method = method or layer.word(f"{block}.pool", "MAX")
    if method not in ("MAX", "AVE"):
        raise InputError(f"layer {layer.name!r}: pooling {method!r}, expected MAX or AVE")
    if layer.flag(f"{block}.global_pooling", False):
        return Built(_GlobalPooling(method), ())
    window, stride = (_pair(layer, block, "kernel_size", 0), _pair(layer, block, "stride", 1))
    if any(step > side for step, side in zip(stride, window, strict=True)):
        # There Caffe pools over windows without a pixel.
        raise InputError(f"layer {layer.name!r}: stride {stride} exceeds the window {window}")
    module = _Pooling(method, window, stride, _pair(layer, block, "pad", 0))
    module.round_up = layer.word(f"{block}.round_mode", "CEIL") not in ("FLOOR", "1")
    return Built(module, ())


class _Within(nn.Module):
    """Response normalisation within each channel, over a square."""

    def __init__(self, side: int, alpha: float, beta: float) -> None:
        super().__init__()
        self.side, self.alpha, self.beta = side, alpha, beta

    def forward(self, values: Tensor) -> Tensor:
        energy = functional.avg_pool2d(values.square(), self.side, 1, self.side // 2)
        return values * (1 + self.alpha * energy).pow(-self.beta)


def _response_normalisation(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    block = "lrn_param"
    size = layer.integer(f"{block}.local_size", 5)
    alpha, beta = layer.real(f"{block}.alpha", 1.0), layer.real(f"{block}.beta", 0.75)
    if size < 1 or size % 2 == 0:
        raise InputError(f"layer {layer.name!r}: local_size is {size}, expected an odd number")
    if layer.word(f"{block}.norm_region", "ACROSS_CHANNELS") in ("WITHIN_CHANNEL", "1"):
        return Built(_Within(size, alpha, beta), ())
    return Built(nn.LocalResponseNorm(size, alpha, beta, layer.real(f"{block}.k", 1.0)), ())


class _FullyConnected(nn.Linear):
    def __init__(self, inputs: int, outputs: int, bias: bool, axis: int) -> None:
        super().__init__(inputs, outputs, bias)
        self.axis = axis

    def forward(self, values: Tensor) -> Tensor:
        return super().forward(values.flatten(self.axis))


def _inner_product(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    block = "inner_product_param"
    axis, bias = layer.integer(f"{block}.axis", 1), layer.flag(f"{block}.bias_term", True)
    if layer.flag(f"{block}.transpose", False):
        raise InputError(f"layer {layer.name!r}: transposed weights are not supported")
    inputs = torch.Size(shapes[0][axis:]).numel()
    module = _FullyConnected(inputs, _outputs(layer, block), bias, axis)
    return Built(module, ("weight", "bias")[: 1 + bias])


def _relu(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    slope = layer.real("relu_param.negative_slope", 0.0)
    return Built(nn.LeakyReLU(slope) if slope else nn.ReLU(), ())


def _prelu(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    shared = layer.flag("prelu_param.channel_shared", False)
    return Built(nn.PReLU(1 if shared else shapes[0][1]), ("weight",))


class _Concat(nn.Module):
    def __init__(self, axis: int) -> None:
        super().__init__()
        self.axis = axis

    def forward(self, *values: Tensor) -> Tensor:
        return torch.cat(values, self.axis)


def _concat(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    axis = layer.integer("concat_param.concat_dim", 1)
    return Built(_Concat(layer.integer("concat_param.axis", axis)), ())


class _Eltwise(nn.Module):
    def __init__(self, operation: str, factors: list[float]) -> None:
        super().__init__()
        self.operation, self.factors = operation, factors

    def forward(self, *values: Tensor) -> Tensor:
        if self.operation == "SUM":
            values = tuple(v * f for v, f in zip(values, self.factors, strict=True))
        result = values[0]
        for other in values[1:]:
            result = _eltwise_steps[self.operation](result, other)
        return result


_eltwise_steps: Mapping[str, Callable[[Tensor, Tensor], Tensor]] = {
    "PROD": torch.mul,
    "SUM": torch.add,
    "MAX": torch.maximum,
}


def _eltwise(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    operation = layer.word("eltwise_param.operation", "SUM")
    factors = [float(factor) for factor in layer.values("eltwise_param.coeff")]
    if operation not in _eltwise_steps or len(factors or shapes) != len(shapes):
        raise InputError(f"layer {layer.name!r}: {operation} with factors {factors}")
    return Built(_Eltwise(operation, factors or [1.0] * len(shapes)), ())


def _softmax(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    return Built(nn.Softmax(layer.integer("softmax_param.axis", 1)), ())


def _flatten(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    first = layer.integer("flatten_param.axis", 1)
    return Built(nn.Flatten(first, layer.integer("flatten_param.end_axis", -1)), ())


class _Reshape(nn.Module):
    def __init__(self, dims: list[int]) -> None:
        super().__init__()
        self.dims = dims

    def forward(self, values: Tensor) -> Tensor:
        # 0 = as it was, -1 = what is left.
        return values.reshape([dim or values.shape[i] for i, dim in enumerate(self.dims)])


def _reshape(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    dims = [dim for dim in layer.values("reshape_param.shape.dim") if type(dim) is int]
    if not dims or sum(not dim for dim in dims) > len(shapes[0]):
        raise InputError(f"layer {layer.name!r}: no shape to reshape {shapes[0]} to")
    return Built(_Reshape(dims), ())


class _BatchNorm(nn.Module):
    mean: Tensor
    variance: Tensor
    divisor: Tensor

    def __init__(self, channels: int, epsilon: float) -> None:
        super().__init__()
        self.epsilon = epsilon
        self.register_buffer("mean", torch.empty(channels))
        self.register_buffer("variance", torch.empty(channels))
        self.register_buffer("divisor", torch.empty(1))

    def forward(self, values: Tensor) -> Tensor:
        factor = torch.where(self.divisor == 0, 0.0, 1 / self.divisor)
        return functional.batch_norm(
            values, self.mean * factor, self.variance * factor, eps=self.epsilon
        )


def _batch_norm(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    module = _BatchNorm(shapes[0][1], layer.real("batch_norm_param.eps", 1e-5))
    return Built(module, ("mean", "variance", "divisor"))


class _Scale(nn.Module):
    def __init__(self, channels: int, bias: bool) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(channels))
        self.bias = nn.Parameter(torch.empty(channels)) if bias else None

    def forward(self, values: Tensor) -> Tensor:
        over_pixels = (1, -1) + (1,) * (values.ndim - 2)
        scaled = values * self.weight.reshape(over_pixels)
        return scaled if self.bias is None else scaled + self.bias.reshape(over_pixels)


def _scale(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    bias = layer.flag("scale_param.bias_term", False)
    if len(shapes) != 1 or layer.integer("scale_param.axis", 1) != 1:
        raise InputError(f"layer {layer.name!r}: scaling by channel alone is supported")
    return Built(_Scale(shapes[0][1], bias), ("weight", "bias")[: 1 + bias])


class _Power(nn.Module):
    def __init__(self, power: float, scale: float, shift: float) -> None:
        super().__init__()
        self.power, self.scale, self.shift = power, scale, shift

    def forward(self, values: Tensor) -> Tensor:
        return (self.shift + self.scale * values).pow(self.power)


def _power(layer: CaffeLayer, shapes: list[Shape]) -> Built:
    settings = (("power", 1.0), ("scale", 1.0), ("shift", 0.0))
    return Built(_Power(*(layer.real(f"power_param.{name}", d) for name, d in settings)), ())


def _without_blobs(make: Callable[[], nn.Module]) -> Callable[[CaffeLayer, list[Shape]], Built]:
    return lambda layer, shapes: Built(make(), ())


_builders: Mapping[str, Callable[[CaffeLayer, list[Shape]], Built]] = {
    "BatchNorm": _batch_norm,
    "Concat": _concat,
    "Convolution": _convolution,
    "Dropout": _without_blobs(nn.Identity),
    "Eltwise": _eltwise,
    "Flatten": _flatten,
    "InnerProduct": _inner_product,
    "LRN": _response_normalisation,
    "PReLU": _prelu,
    "Pooling": _pooling,
    "Power": _power,
    "ReLU": _relu,
    "Reshape": _reshape,
    "Scale": _scale,
    "Sigmoid": _without_blobs(nn.Sigmoid),
    "Softmax": _softmax,
    "Split": _without_blobs(nn.Identity),
    "TanH": _without_blobs(nn.Tanh),
}
