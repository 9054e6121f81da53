"""SqueezeNet v1.0: AlexNet's accuracy on ImageNet with a fiftieth of its weights.

Conventions
- Input is float32 (N, 3, 227, 227), BGR, 0..255 less (104, 117, 123): the Caffe weights' own.
- Pooling rounds up, as Caffe's does: 111 -> 55 -> 27 -> 13.
- `forward` gives a fire module's output after its ReLU: fire9 is 512 x 13 x 13.
- `load_named` takes names as in the published file (``fire2/conv1x1_1.weight``) or with Caffe's
  numbering of blobs (``fire2/conv1x1_1.0`` weight, ``.1`` bias).

References
----------
Iandola, Han, Moskewicz, Ashraf, Dally, Keutzer: SqueezeNet: AlexNet-level accuracy with 50x fewer
parameters and <0.5MB model size, 2016, table 1.
"""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import ConfigError, InputError

__all__ = ["SqueezeNet"]

FIRES = {2: (96, 16, 64), 3: (128, 16, 64), 4: (128, 32, 128), 5: (256, 32, 128),
         6: (256, 48, 192), 7: (384, 48, 192), 8: (384, 64, 256), 9: (512, 64, 256)}  # fmt: skip
"""Fire module -> channels in, squeezed, and of each of its two expansions."""
_POOLED_AFTER = (4, 8)
_N_CLASSES = 1000
_BLOBS = {"weight": "0", "bias": "1"}


class _Fire(nn.Module):
    """Squeeze by 1 x 1, expand by 1 x 1 and 3 x 3, concatenate."""

    def __init__(self, inputs: int, squeezed: int, expanded: int) -> None:
        super().__init__()
        self.conv1x1_1 = nn.Conv2d(inputs, squeezed, 1)
        self.conv1x1_2 = nn.Conv2d(squeezed, expanded, 1)
        self.conv3x3_2 = nn.Conv2d(squeezed, expanded, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, 2 * expanded, H, W)."""
        squeezed = functional.relu(self.conv1x1_1(x))
        return functional.relu(torch.cat([self.conv1x1_2(squeezed), self.conv3x3_2(squeezed)], 1))


class SqueezeNet(nn.Module):
    """SqueezeNet v1.0, whole or cut after a fire module.

    Parameters
    ----------
    last_fire : int in [2, 9]
        The fire module whose output is given.
    head : bool
        Whether the classifier follows (needs ``last_fire=9``).
    """

    def __init__(self, last_fire: int = 9, head: bool = False) -> None:
        super().__init__()
        if last_fire not in FIRES:
            raise ConfigError(f"last_fire: got {last_fire}, expected 2 to 9")
        if head and last_fire < max(FIRES):
            raise ConfigError(f"the classifier needs fire module 9, got last_fire={last_fire}")
        self.conv1 = nn.Conv2d(3, 96, 7, 2)
        self.fires = nn.ModuleDict(
            {f"fire{number}": _Fire(*FIRES[number]) for number in FIRES if number <= last_fire}
        )
        self.has_head = head
        if head:
            self.conv_final = nn.Conv2d(2 * FIRES[9][2], _N_CLASSES, 1, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        """Return the last fire module's output (N, C, h, w), or the classes' scores (N, 1000)."""
        features = self.features(x)
        if not self.has_head:
            return features
        return functional.relu(self.conv_final(features)).mean(dim=(2, 3))

    def features(self, x: Tensor) -> Tensor:
        """Return the last fire module's output, after its ReLU and before any pooling."""
        x = _pool(functional.relu(self.conv1(x)))
        last = max(int(name[4:]) for name in self.fires)
        for number in range(2, last + 1):
            x = self.fires[f"fire{number}"](x)
            if number in _POOLED_AFTER and number < last:
                x = _pool(x)
        return x

    def load_named(self, tensors: Mapping[str, Any]) -> None:
        """Take published weights by their Caffe names; what was cut off is left out.

        Raises
        ------
        InputError
            If one that is needed is missing or has another shape.
        """
        chosen = {}
        for name, value in self.state_dict().items():
            tensor = torch.as_tensor(_find(tensors, name)).to(value.dtype)
            if tensor.numel() != value.numel() or tensor.shape[:1] != value.shape[:1]:
                raise InputError(
                    f"weights of SqueezeNet: {name!r} has shape {tuple(tensor.shape)}, "
                    f"expected {tuple(value.shape)}; weights of another network?"
                )
            chosen[name] = tensor.reshape(value.shape)
        self.load_state_dict(chosen)


def _find(tensors: Mapping[str, Any], name: str) -> Any:
    """Return the tensor of `fires.fire2.conv1x1_1.weight` under any of its published names."""
    layer, kind = name.removeprefix("fires.").rsplit(".", 1)
    caffe = layer.replace(".", "/")
    for known in (name, f"{caffe}.{kind}", f"{caffe}.{_BLOBS[kind]}"):
        if known in tensors:
            return tensors[known]
    raise InputError(
        f"weights of SqueezeNet: no '{caffe}.{kind}' among {len(tensors)} tensors; "
        "weights of another network?"
    )


def _pool(x: Tensor) -> Tensor:
    return functional.max_pool2d(x, 3, 2, ceil_mode=True)
