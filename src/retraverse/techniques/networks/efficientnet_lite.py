"""EfficientNet-Lite0: mobile inverted bottlenecks without squeeze-and-excitation.

Conventions
- Input is float32 (N, 3, H, W), RGB, ``(pixel - 127) / 128`` of 0..255: the weights were made
  so. The mean and deviation of ImageNet, which other networks want, cost 9 points of top-1.
- Nominal size is 224 x 224; any other works, since padding is computed from the size that comes.
- Module names are those of the published PyTorch weights (``_conv_stem``, ``_blocks.7…``, ``_fc``).
- Block numbers start at 0: "block 7" is what ``n_blocks=8`` ends with, 80 x 14 x 14.

References
----------
Tan, Le: EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks, ICML 2019,
table 1; Liu: Higher accuracy on vision models with EfficientNet-Lite, TensorFlow blog, 2020
(no squeeze-and-excitation, ReLU6, stem and head not scaled).
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import ConfigError, InputError

__all__ = ["LITE0_BLOCKS", "BlockShape", "EfficientNetLite0", "SameConv2d"]

_BN_EPSILON = 1e-3
_BN_MOMENTUM = 0.01
_STEM_CHANNELS = 32
_HEAD_CHANNELS = 1280
_N_CLASSES = 1000


class BlockShape(NamedTuple):
    """One inverted bottleneck: kernel, stride, expansion, channels in and out."""

    kernel: int
    stride: int
    expansion: int
    inputs: int
    outputs: int


_STAGES = (
    # repeats, kernel, stride, expansion, channels out
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)


def _block_shapes() -> tuple[BlockShape, ...]:
    shapes: list[BlockShape] = []
    inputs = _STEM_CHANNELS
    for repeats, kernel, stride, expansion, outputs in _STAGES:
        for repeat in range(repeats):
            shapes.append(BlockShape(kernel, 1 if repeat else stride, expansion, inputs, outputs))
            inputs = outputs
    return tuple(shapes)


LITE0_BLOCKS = _block_shapes()
"""The 16 blocks in order."""


class SameConv2d(nn.Conv2d):
    """A convolution padded as TensorFlow's SAME: output = ceil(input / stride).

    Where the padding is odd, the extra row and column go below and to the right.
    """

    def forward(self, input: Tensor) -> Tensor:  # the name nn.Conv2d gives it
        """Return the convolution of (N, C, H, W)."""
        bottom, top = self._padding_of(int(input.shape[-2]), 0)
        right, left = self._padding_of(int(input.shape[-1]), 1)
        if top == bottom and left == right:
            return functional.conv2d(
                input, self.weight, self.bias, self.stride, (top, left), 1, self.groups
            )
        padded = functional.pad(input, (left, right, top, bottom))
        return functional.conv2d(padded, self.weight, self.bias, self.stride, 0, 1, self.groups)

    def _padding_of(self, size: int, axis: int) -> tuple[int, int]:
        """Return how many rows to add after and before."""
        kernel, stride = self.kernel_size[axis], self.stride[axis]
        total = max((-(-size // stride) - 1) * stride + kernel - size, 0)
        return total - total // 2, total // 2


class _Block(nn.Module):
    """Expand, filter each channel, project; added to its input where the shapes allow."""

    def __init__(self, shape: BlockShape) -> None:
        super().__init__()
        hidden = shape.inputs * shape.expansion
        self._expands = shape.expansion > 1
        self._skips = shape.stride == 1 and shape.inputs == shape.outputs
        if self._expands:
            self._expand_conv = SameConv2d(shape.inputs, hidden, 1, bias=False)
            self._bn0 = _norm(hidden)
        self._depthwise_conv = SameConv2d(
            hidden, hidden, shape.kernel, shape.stride, groups=hidden, bias=False
        )
        self._bn1 = _norm(hidden)
        self._project_conv = SameConv2d(hidden, shape.outputs, 1, bias=False)
        self._bn2 = _norm(shape.outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, outputs, H / stride, W / stride)."""
        y = functional.relu6(self._bn0(self._expand_conv(x))) if self._expands else x
        y = functional.relu6(self._bn1(self._depthwise_conv(y)))
        projected: Tensor = self._bn2(self._project_conv(y))
        return projected + x if self._skips else projected


class EfficientNetLite0(nn.Module):
    """EfficientNet-Lite0, whole or cut after a block.

    Parameters
    ----------
    n_blocks : int in [1, 16]
        How many blocks are kept; 8 ends with block 7.
    head : bool
        Whether the classifier follows (needs all 16 blocks); else `forward` gives the last
        block's output.
    n_classes : int
        Classes of the classifier.
    """

    def __init__(self, n_blocks: int = 16, head: bool = False, n_classes: int = _N_CLASSES) -> None:
        super().__init__()
        if not 1 <= n_blocks <= len(LITE0_BLOCKS):
            raise ConfigError(f"n_blocks: got {n_blocks}, expected 1 to {len(LITE0_BLOCKS)}")
        if head and n_blocks < len(LITE0_BLOCKS):
            raise ConfigError(f"the classifier needs all 16 blocks, got n_blocks={n_blocks}")
        self._conv_stem = SameConv2d(3, _STEM_CHANNELS, 3, 2, bias=False)
        self._bn0 = _norm(_STEM_CHANNELS)
        self._blocks = nn.ModuleList(_Block(shape) for shape in LITE0_BLOCKS[:n_blocks])
        self.has_head = head
        if head:
            self._conv_head = SameConv2d(LITE0_BLOCKS[-1].outputs, _HEAD_CHANNELS, 1, bias=False)
            self._bn1 = _norm(_HEAD_CHANNELS)
            self._fc = nn.Linear(_HEAD_CHANNELS, n_classes)

    @property
    def n_channels(self) -> int:
        """Channels of the last block kept."""
        return LITE0_BLOCKS[len(self._blocks) - 1].outputs

    def forward(self, x: Tensor) -> Tensor:
        """Return the last block's output (N, C, h, w), or the classes' scores (N, n_classes)."""
        features = self.features(x)
        if not self.has_head:
            return features
        pooled = functional.relu6(self._bn1(self._conv_head(features))).mean(dim=(2, 3))
        scores: Tensor = self._fc(pooled)
        return scores

    def features(self, x: Tensor) -> Tensor:
        """Return the last block's output: linear, not clipped by a ReLU6."""
        x = functional.relu6(self._bn0(self._conv_stem(x)))
        for block in self._blocks:
            x = block(x)
        return x

    def load_named(self, tensors: Mapping[str, Any]) -> None:
        """Take published weights by name; what was cut off is left out.

        Parameters
        ----------
        tensors : mapping of name to array or Tensor
            Names as in ``efficientnet-lite0-57934424.pth``; any float type.

        Raises
        ------
        InputError
            If one that is needed is missing or has another shape: other weights than these.
        """
        own = self.state_dict()
        chosen = {}
        for name, value in own.items():
            if name.endswith("num_batches_tracked"):
                continue
            if name not in tensors:
                raise InputError(
                    f"weights of EfficientNet-Lite0: no {name!r} among {len(tensors)} tensors; "
                    "weights of another network?"
                )
            tensor = torch.as_tensor(tensors[name]).to(value.dtype)
            if tensor.shape != value.shape:
                raise InputError(
                    f"weights of EfficientNet-Lite0: {name!r} has shape {tuple(tensor.shape)}, "
                    f"expected {tuple(value.shape)}; weights of another network?"
                )
            chosen[name] = tensor
        self.load_state_dict(chosen, strict=False)


def _norm(n_channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(n_channels, eps=_BN_EPSILON, momentum=_BN_MOMENTUM)
