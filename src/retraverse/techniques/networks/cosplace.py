"""The network of CosPlace and EigenPlaces: a backbone, generalised mean pooling, one linear layer.

Names of parameters are the published ones but for the backbone, which checkpoints number
(``backbone.4.0.conv1.weight``): `load_named` knows.

References
----------
Berton, Masone, Caputo: Rethinking Visual Geo-localization for Large-Scale Applications, CVPR 2022,
section 4. Berton, Trivigno, Caputo, Masone: EigenPlaces, ICCV 2023, section 4: the same network.
Radenović, Tolias, Chum: Fine-tuning CNN Image Retrieval with No Human Annotation, TPAMI 2019,
equation 3 (generalised mean).
"""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.techniques.networks.published import load_published
from retraverse.techniques.networks.resnet import RESNET_CHANNELS, SEQUENTIAL_NAMES, ResNet

__all__ = ["CosPlaceNet", "GeneralisedMean"]

_VGG16_PLAN = (64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512)
"""Channels of VGG16's convolutions; 0 = maximum of 2 x 2."""


class GeneralisedMean(nn.Module):
    """Generalised mean of every map, its power learned."""

    def __init__(self, power: float = 3.0, least: float = 1e-6) -> None:
        super().__init__()
        self.p = nn.Parameter(torch.full((1,), power))
        self._least = least

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C) for (N, C, H, W)."""
        return x.clamp(min=self._least).pow(self.p).mean((2, 3)).pow(1 / self.p)


class CosPlaceNet(nn.Module):
    """Descriptors of CosPlace or EigenPlaces.

    Parameters
    ----------
    backbone : {"VGG16", "ResNet18", "ResNet50", "ResNet101", "ResNet152"}
    dimension : int
        Length of the descriptor.
    """

    def __init__(self, backbone: str, dimension: int) -> None:
        super().__init__()
        self.backbone: nn.Module
        self._renames: tuple[tuple[str, str], ...]
        if backbone == "VGG16":
            self.backbone, channels, self._renames = _vgg16(), _VGG16_PLAN[-1], ()
        else:
            depth = int(backbone.removeprefix("ResNet"))
            self.backbone, channels = ResNet(depth), RESNET_CHANNELS[depth]
            self._renames = tuple(
                (f"backbone.{number}", f"backbone.{name}") for number, name in SEQUENTIAL_NAMES
            )
        # Numbered as published: 0 and 4 normalise, 2 flattens.
        self.aggregation = nn.ModuleDict(
            {"1": GeneralisedMean(), "3": nn.Linear(channels, dimension)}
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors (N, dimension) for pictures (N, 3, H, W)."""
        maps = functional.normalize(self.backbone(x), dim=1)
        pooled = self.aggregation["1"](maps)
        return functional.normalize(self.aggregation["3"](pooled), dim=1)

    def load_named(self, tensors: Mapping[str, Any], owner: str = "cosplace") -> None:
        """Load an official checkpoint; InputError if it is another network's."""
        load_published(self, tensors, owner, renames=self._renames)


def _vgg16() -> nn.Sequential:
    """Return VGG16's convolutions to the last one, before its ReLU, numbered as published."""
    layers: list[nn.Module] = []
    channels = 3
    for width in _VGG16_PLAN:
        if width:
            layers += [nn.Conv2d(channels, width, 3, padding=1), nn.ReLU()]
            channels = width
        else:
            layers.append(nn.MaxPool2d(2))
    return nn.Sequential(*layers[:-1])
