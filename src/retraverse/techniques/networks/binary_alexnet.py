"""AlexNet with weights and activations of one bit: BinaryNet, FloppyNet, ShallowNet.

Conventions
- Input is float32 (N, 3, 227, 227), RGB, 0..1.
- Weights are -1 or 1, and so is what goes into every convolution but the first: 1 where a value
  is at least 0. Computed in float32, which is exact: sums stay far below 2**24.
- Pooling is 2 x 2; normalisation is a scale and an offset per channel.
- `load_named` takes the tensors of the published TensorFlow Lite files, or the network's own.

References
----------
Ferrarini, Milford, McDonald-Maier, Ehsan: Binary Neural Networks for Memory-Efficient and
Effective Visual Place Recognition in Changing Environments, T-RO 2022.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import InputError
from retraverse.techniques.networks.loading import load_checked

__all__ = ["BINARY_NETS", "BinaryAlexNet", "BinaryTable"]

_FIRST_OUTPUTS = 96


@dataclass(frozen=True)
class BinaryTable:
    """The binary convolutions of one network, from conv2 on."""

    convolutions: tuple[tuple[int, int, bool], ...]
    """Maps out, side of the kernel, whether 2 x 2 pooling follows."""
    border: float
    """What lies outside the maps: 1, so that one bit does everywhere, or 0."""


_SHALLOW = ((256, 5, True), (256, 3, True))
BINARY_NETS: dict[str, BinaryTable] = {
    "binarynet": BinaryTable(
        ((256, 5, True), (384, 3, False), (384, 3, False), (256, 3, True)), border=1.0
    ),
    "floppynet": BinaryTable(_SHALLOW, border=1.0),
    "shallownet": BinaryTable(_SHALLOW, border=0.0),
}


class _BinaryConv(nn.Module):
    """Scale and offset, sign, convolution, and perhaps pooling."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, *, border: float, pooled: bool
    ) -> None:
        super().__init__()
        self._border = border
        self._pooled = pooled
        self.scale = nn.Parameter(torch.ones(inputs))
        self.offset = nn.Parameter(torch.randn(inputs))
        self.weight = nn.Parameter(_signs(torch.randn(outputs, inputs, kernel, kernel)))

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, outputs, H, W), pooled or not."""
        signs = _signs(x * self.scale[:, None, None] + self.offset[:, None, None])
        margin = self.weight.shape[-1] // 2
        signs = functional.pad(signs, (margin,) * 4, value=self._border)
        x = functional.conv2d(signs, self.weight)
        return functional.max_pool2d(x, 2) if self._pooled else x


class BinaryAlexNet(nn.Module):
    """One of `BINARY_NETS`: (N, 3, 227, 227) to the last pooled maps (N, 256, 6, 6).

    Parameters
    ----------
    kind : str
        A key of `BINARY_NETS`.
    """

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._kind = kind
        table = BINARY_NETS[kind]
        self.conv1 = nn.Conv2d(3, _FIRST_OUTPUTS, 11, 4)
        with torch.no_grad():
            self.conv1.weight.copy_(_signs(self.conv1.weight))
        widths = [_FIRST_OUTPUTS, *(outputs for outputs, _, _ in table.convolutions)]
        self.binary = nn.ModuleList(
            _BinaryConv(inputs, outputs, kernel, border=table.border, pooled=pooled)
            for inputs, (outputs, kernel, pooled) in zip(
                widths[:-1], table.convolutions, strict=True
            )
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return the maps (N, 256, 6, 6): whole numbers."""
        x = functional.max_pool2d(self.conv1(x), 2)
        for convolution in self.binary:
            x = convolution(x)
        return x

    def load_named(self, tensors: Mapping[str, Any]) -> None:
        """Take the published weights.

        Raises
        ------
        InputError
            If one that is needed is missing or has another shape.
        """
        if "conv1.weight" not in tensors:
            tensors = self._from_tflite(tensors)
        load_checked(self, tensors, self._kind)

    def _from_tflite(self, tensors: Mapping[str, Any]) -> dict[str, Any]:
        """Return the tensors of a TensorFlow Lite file under the network's names.

        The converter names a tensor after whichever operator used it last, and cuts names off, so
        kernels are told by their shape and normalisations by the layer in their name.
        """
        arrays = {name: np.asarray(tensor) for name, tensor in tensors.items()}
        kernels = [array.transpose(0, 3, 1, 2) for array in arrays.values() if array.ndim == 4]
        first = _only(kernels, (_FIRST_OUTPUTS, 3, 11, 11), self._kind)
        own = {"conv1.weight": first, "conv1.bias": np.zeros(_FIRST_OUTPUTS, np.float32)}
        for index, module in enumerate(self.binary):
            assert isinstance(module, _BinaryConv)
            own[f"binary.{index}.weight"] = _only(kernels, tuple(module.weight.shape), self._kind)
            scale, offset = _normalisation(arrays, f"conv{index + 2}_bn", self._kind)
            own[f"binary.{index}.scale"], own[f"binary.{index}.offset"] = scale, offset
        return own


def _signs(x: Tensor) -> Tensor:
    """Return 1 where a value is at least 0, else -1."""
    return torch.where(x >= 0, 1.0, -1.0)


def _only(kernels: Iterable[Any], shape: tuple[int, ...], owner: str) -> Any:
    found = [kernel for kernel in kernels if kernel.shape == shape]
    if len(found) != 1:
        raise InputError(
            f"weights of {owner}: {len(found)} kernels of shape {shape}, expected one; "
            "weights of another network?"
        )
    return found[0]


def _normalisation(arrays: Mapping[str, Any], layer: str, owner: str) -> tuple[Any, Any]:
    """Return scale and offset: without a trained factor the scale is 1 / sigma, all positive."""
    found = [array for name, array in arrays.items() if layer in name and array.ndim == 1]
    scales = [array for array in found if (array > 0).all()]
    offsets = [array for array in found if not (array > 0).all()]
    if len(scales) != 1 or len(offsets) != 1:
        raise InputError(
            f"weights of {owner}: {len(found)} vectors for the normalisation {layer!r}, "
            "expected a scale (all positive) and an offset; weights of another network?"
        )
    return scales[0], offsets[0]
