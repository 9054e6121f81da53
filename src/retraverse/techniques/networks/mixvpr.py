"""MixVPR: what a ResNet50 sees at each of its 20 x 20 places, mixed over the whole picture.

Names of parameters are those of the published checkpoints.

References
----------
Ali-bey, Chaib-draa, Giguère: MixVPR: Feature Mixing for Visual Place Recognition, WACV 2023,
section 3: equations 2 to 5.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from torch import Tensor, nn
from torch.nn import functional

from retraverse.techniques.networks.published import load_published
from retraverse.techniques.networks.resnet import ResNet

__all__ = ["MixVprNet"]

SIDE = 20
"""Places along a side: a picture of 320 x 320 at a sixteenth."""
N_MIXERS = 4
_ROW_BIAS = "aggregator.row_proj.bias"


class _Mixer(nn.Module):
    """One map at a time: every place hears of every other (equation 3)."""

    def __init__(self, n_places: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(
            nn.LayerNorm(n_places),
            nn.Linear(n_places, n_places),
            nn.ReLU(),
            nn.Linear(n_places, n_places),
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C, places) for the same."""
        mixed: Tensor = x + self.mix(x)
        return mixed


class _Aggregator(nn.Module):
    def __init__(self, channels: int, out_channels: int, out_rows: int) -> None:
        super().__init__()
        n_places = SIDE * SIDE
        self.mix = nn.Sequential(*(_Mixer(n_places) for _ in range(N_MIXERS)))
        self.channel_proj = nn.Linear(channels, out_channels)
        self.row_proj = nn.Linear(n_places, out_rows)

    def forward(self, maps: Tensor) -> Tensor:
        """Return unit vectors (N, out_channels * out_rows): equations 4 and 5."""
        mixed = self.mix(maps.flatten(2))
        projected = self.channel_proj(mixed.transpose(1, 2)).transpose(1, 2)
        return functional.normalize(self.row_proj(projected).flatten(1), dim=1)


class MixVprNet(nn.Module):
    """Descriptors of MixVPR on ResNet50.

    Parameters
    ----------
    out_channels, out_rows : int
        The descriptor has their product: 1024 x 4, 256 x 2 or 64 x 2 as published.
    """

    def __init__(self, out_channels: int = 1024, out_rows: int = 4) -> None:
        super().__init__()
        backbone = ResNet(50, n_stages=3)
        self.backbone = nn.ModuleDict({"model": backbone})
        self.aggregator = _Aggregator(backbone.channels, out_channels, out_rows)

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors for pictures (N, 3, 320, 320)."""
        vectors: Tensor = self.aggregator(self.backbone["model"](x))
        return vectors

    def load_named(self, tensors: Mapping[str, Any], owner: str = "mixvpr") -> None:
        """Load an official checkpoint; InputError if it is another network's.

        The first version of the authors' code had no bias in its last layer: there it is zero.
        """
        rows = self.aggregator.row_proj.out_features
        bias = {_ROW_BIAS: np.zeros(rows, np.float32)}
        load_published(self, {**bias, **tensors}, owner)
