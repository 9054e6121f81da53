"""BoQ: bags of learned queries that ask a picture's features what is where.

Names of parameters are those of the published checkpoints; a ResNet's parts are numbered there:
`BoqNet.load_named` knows.

References
----------
Ali-bey, Chaib-draa, Giguère: BoQ: A Place is Worth a Bag of Learnable Queries, CVPR 2024,
section 3. Vaswani, Shazeer, Parmar et al.: Attention Is All You Need, NIPS 2017, section 3.2.
"""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.techniques.networks.dinov2 import PATCH, DinoV2
from retraverse.techniques.networks.published import load_published
from retraverse.techniques.networks.resnet import SEQUENTIAL_NAMES, ResNet

__all__ = ["Attention", "BoqNet", "Encoder"]

N_QUERIES, N_BAGS = 64, 2
HEAD_WIDTH = 64


class Attention(nn.Module):
    """Multi-head attention, its parameters named as PyTorch's own.

    Parameters
    ----------
    width : int
        A multiple of 64, the width of a head.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self._heads = width // HEAD_WIDTH
        self.in_proj_weight = nn.Parameter(torch.empty(3 * width, width))
        self.in_proj_bias = nn.Parameter(torch.zeros(3 * width))
        self.out_proj = nn.Linear(width, width)
        nn.init.xavier_uniform_(self.in_proj_weight)

    def forward(self, asking: Tensor, asked: Tensor) -> Tensor:
        """Return what `asking` (N, q, width) hears from `asked` (N, t, width): (N, q, width)."""
        weights, biases = self.in_proj_weight.chunk(3), self.in_proj_bias.chunk(3)
        query, key, value = (
            self._split(functional.linear(x, weight, bias))
            for x, weight, bias in zip((asking, asked, asked), weights, biases, strict=True)
        )
        heard = functional.scaled_dot_product_attention(query, key, value)
        mixed: Tensor = self.out_proj(heard.transpose(1, 2).flatten(2))
        return mixed

    def _split(self, x: Tensor) -> Tensor:
        return x.reshape(x.shape[0], x.shape[1], self._heads, HEAD_WIDTH).transpose(1, 2)


class Encoder(nn.Module):
    """A transformer's encoder layer, normalised after each half, its hidden layer four times wide.

    Parameters
    ----------
    width : int
        A multiple of 64.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.self_attn = Attention(width)
        self.linear1 = nn.Linear(width, 4 * width)
        self.linear2 = nn.Linear(4 * width, width)
        self.norm1 = nn.LayerNorm(width)
        self.norm2 = nn.LayerNorm(width)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, t, width)."""
        x = self.norm1(x + self.self_attn(x, x))
        y: Tensor = self.norm2(x + self.linear2(functional.relu(self.linear1(x))))
        return y


class _Bag(nn.Module):
    """One encoder and one bag of queries."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.encoder = Encoder(width)
        self.queries = nn.Parameter(torch.randn(1, N_QUERIES, width))
        self.self_attn = Attention(width)
        self.norm_q = nn.LayerNorm(width)
        self.cross_attn = Attention(width)
        self.norm_out = nn.LayerNorm(width)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the refined features (N, t, width) and the answers (N, 64, width)."""
        x = self.encoder(x)
        queries = self.norm_q(self.queries + self.self_attn(self.queries, self.queries))
        answers = self.cross_attn(queries.expand(x.shape[0], -1, -1), x)
        return x, self.norm_out(answers)


class _Aggregator(nn.Module):
    def __init__(self, channels: int, width: int, rows: int) -> None:
        super().__init__()
        self.proj_c = nn.Conv2d(channels, width, 3, padding=1)
        self.norm_input = nn.LayerNorm(width)
        self.boqs = nn.ModuleList(_Bag(width) for _ in range(N_BAGS))
        self.fc = nn.Linear(N_BAGS * N_QUERIES, rows)

    def forward(self, maps: Tensor) -> Tensor:
        """Return unit vectors (N, width * rows)."""
        x = self.norm_input(self.proj_c(maps).flatten(2).transpose(1, 2))
        answers = []
        for bag in self.boqs:
            x, answer = bag(x)
            answers.append(answer)
        rows = self.fc(torch.cat(answers, 1).transpose(1, 2))
        return functional.normalize(rows.flatten(1), dim=1)


class _DinoMaps(nn.Module):
    """DINOv2's patches, without its last normalisation."""

    def __init__(self, dino: DinoV2) -> None:
        super().__init__()
        self.dino = dino

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, width, h, w)."""
        return self.dino.maps(self.dino(x), x.shape[2] // PATCH, x.shape[3] // PATCH)


class BoqNet(nn.Module):
    """Descriptors of BoQ.

    Parameters
    ----------
    backbone : {"resnet50", "dinov2"}
    dimension : int
        Length of the descriptor: a multiple of 512 (ResNet50) or 384 (DINOv2).
    dino : DinoV2, optional
        Default: ViT-B/14, as published.
    """

    def __init__(self, backbone: str, dimension: int, dino: DinoV2 | None = None) -> None:
        super().__init__()
        self.backbone: nn.Module
        if backbone == "resnet50":
            resnet = ResNet(50, n_stages=3)
            self.backbone, channels, width = nn.Sequential(), resnet.channels, 512
            self.backbone.add_module("net", resnet)
        else:
            dino = dino or DinoV2()
            self.backbone, channels, width = _DinoMaps(dino), dino.width, 384
        self.aggregator = _Aggregator(channels, width, dimension // width)

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors for pictures (N, 3, H, W)."""
        vectors: Tensor = self.aggregator(self.backbone(x))
        return vectors

    def load_named(self, tensors: Mapping[str, Any], owner: str = "boq") -> None:
        """Load an official checkpoint; InputError if it is another network's."""
        renames = [
            (f"backbone.net.{number}", f"backbone.net.{name}") for number, name in SEQUENTIAL_NAMES
        ]
        load_published(self, tensors, owner, renames=renames, unused=(r".*\.mask_token",))
