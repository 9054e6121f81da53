"""MobileNetV2 up to the addition of its block 9, and NetVLAD with 16 clusters on top.

Conventions
- Input is float32 (N, 3, H, W), BGR, ``(pixel - 128) * 2 / 255``: about -1 to 1.
- Any size of at least 32 pixels; maps are one sixteenth of it, 64 channels.
- A stride of 2 pads below and to the right only, as the Keras model does.
- `load_named` takes the names of the Keras file (``block_1_expand/…/kernel:0``), of the frozen
  TensorFlow graph (``block_1_expand/kernel``), or the network's own.

References
----------
Sandler, Howard, Zhu, Zhmoginov, Chen: MobileNetV2: Inverted Residuals and Linear Bottlenecks,
CVPR 2018, table 2; Kuse, Shen: Learning Whole-Image Descriptors for Real-time Loop Detection and
Kidnap Recovery under Large Viewpoint Difference, Robotics and Autonomous Systems 2021.
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import InputError
from retraverse.techniques.networks.loading import load_checked
from retraverse.techniques.networks.netvlad_layer import NetVlad

__all__ = ["N_CLUSTERS", "MobileNetNetVlad"]

N_CLUSTERS = 16
_BN_EPSILON = 1e-3
_BLOCKS = (
    # stride, channels in, expanded, out: blocks 1 to 9
    (2, 16, 96, 24), (1, 24, 144, 24), (2, 24, 144, 32), (1, 32, 192, 32), (1, 32, 192, 32),
    (2, 32, 192, 64), (1, 64, 384, 64), (1, 64, 384, 64), (1, 64, 384, 64),
)  # fmt: skip
_OWNER = "MobileNetV2-NetVLAD"


class _Block(nn.Module):
    """Expand by 1 x 1, filter each channel by 3 x 3, project by 1 x 1; add the input if it fits."""

    def __init__(self, stride: int, inputs: int, expanded: int, outputs: int) -> None:
        super().__init__()
        self._stride = stride
        self._adds = stride == 1 and inputs == outputs
        self.expand = nn.Identity() if expanded == inputs else _conv(inputs, expanded, 1)
        self.depthwise = _conv(expanded, expanded, 3, stride, groups=expanded)
        self.project = _conv(expanded, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, outputs, H / stride, W / stride)."""
        wide = x if isinstance(self.expand, nn.Identity) else functional.relu6(self.expand(x))
        wide = functional.relu6(self.depthwise(_padded(wide, self._stride)))
        out: Tensor = self.project(wide)
        return x + out if self._adds else out


class MobileNetNetVlad(nn.Module):
    """The network: (N, 3, H, W) to unit vectors (N, 1024)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = _conv(3, 32, 3, 2)
        self.blocks = nn.ModuleList([_Block(1, 32, 32, 16), *(_Block(*shape) for shape in _BLOCKS)])
        self.vlad = NetVlad(_BLOCKS[-1][-1], N_CLUSTERS, bias=True, normalise_input=False)

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors (N, 1024)."""
        vectors: Tensor = self.vlad(self.features(x))
        return vectors

    def features(self, x: Tensor) -> Tensor:
        """Return the maps (N, 64, H / 16, W / 16)."""
        x = functional.relu6(self.stem(_padded(x, 2)))
        for block in self.blocks:
            x = block(x)
        return x

    def load_named(self, tensors: Mapping[str, Any]) -> None:
        """Take published weights.

        Raises
        ------
        InputError
            If one that is needed is missing or has another shape.
        """
        if "vlad.centres" in tensors:
            load_checked(self, tensors, _OWNER)
            return
        renamed = {}
        for name, tensor in tensors.items():
            own = _own_name(name)
            if own is not None:
                renamed[own] = _own_axes(own, np.asarray(tensor))
        if not renamed:
            raise InputError(
                f"weights of {_OWNER}: none of {len(tensors)} tensors is one of its; "
                "weights of another network?"
            )
        load_checked(self, {**_batch_counts(self), **renamed}, _OWNER)


def _conv(inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, groups=groups, bias=False),
        nn.BatchNorm2d(outputs, eps=_BN_EPSILON),
    )


def _padded(x: Tensor, stride: int) -> Tensor:
    """Return maps padded for a kernel of 3: all around, or for a stride of 2 below and right."""
    return functional.pad(x, (1, 1, 1, 1) if stride == 1 else (0, 1, 0, 1))


_KINDS = {
    "kernel": "0.weight",
    "depthwise_kernel": "0.weight",
    "gamma": "1.weight",
    "beta": "1.bias",
    "moving_mean": "1.running_mean",
    "moving_variance": "1.running_var",
}
_VLAD = {"kernel": "assignment.weight", "bias": "assignment.bias", "cluster_centers": "centres"}


def _own_name(name: str) -> str | None:
    """Return the network's name of a published tensor, None for one it has no use for."""
    layer, kind = name.split("/")[0], name.rsplit("/", 1)[-1].removesuffix(":0")
    if layer.startswith("net_vlad_layer"):
        return f"vlad.{_VLAD[kind]}" if kind in _VLAD else None
    if kind not in _KINDS:
        return None
    if layer in ("Conv1", "bn_Conv1"):
        return f"stem.{_KINDS[kind]}"
    found = re.fullmatch(r"(?:block_(\d+)|expanded_conv)_(expand|depthwise|project)(?:_BN)?", layer)
    return found and f"blocks.{found[1] or 0}.{found[2]}.{_KINDS[kind]}"


def _own_axes(name: str, tensor: Any) -> Any:
    """Return a TensorFlow tensor in PyTorch's order of axes."""
    if name == "vlad.centres":
        # The Keras layer adds what it stores, so the centres are its negatives.
        return -tensor.reshape(tensor.shape[-2:]).T
    if name == "vlad.assignment.weight":
        return tensor.reshape(tensor.shape[-2:]).T
    if tensor.ndim == 4:
        return tensor.transpose((2, 3, 0, 1) if ".depthwise." in name else (3, 2, 0, 1))
    return tensor


def _batch_counts(network: nn.Module) -> dict[str, Tensor]:
    """Return the counters of batches, which published weights do not have."""
    return {name: value for name, value in network.state_dict().items() if value.ndim == 0}
