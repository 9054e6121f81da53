"""SALAD and MegaLoc: patches of DINOv2 shared out among clusters by optimal transport.

Names of parameters are those of the published checkpoints.

References
----------
Izquierdo, Civera: Optimal Transport Aggregation for Visual Place Recognition, CVPR 2024,
section 3: equations 2 to 7. Berton, Masone: MegaLoc: One Retrieval to Place Them All, CVPR
Workshops 2025, section 3: clusters twice as long, then one linear layer.
Cuturi: Sinkhorn Distances, NIPS 2013.
"""

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.techniques.networks.dinov2 import PATCH, DinoV2
from retraverse.techniques.networks.published import load_published

__all__ = ["MegaLocNet", "SaladNet", "share_out"]

N_CLUSTERS, TOKEN_LENGTH, HIDDEN = 64, 256, 512
N_ROUNDS = 3
"""Of Sinkhorn's normalisation."""
_UNUSED = (r"backbone\.model\.mask_token",)
"""What DINOv2's own training used."""


def share_out(scores: Tensor, dustbin: Tensor, n_rounds: int = N_ROUNDS) -> Tensor:
    """Return how much of each patch each cluster gets.

    Every patch gives 1, every cluster takes 1, and the dustbin the other n - m: Sinkhorn's rounds,
    in logarithms, make rows and columns add up in turn.

    Parameters
    ----------
    scores : Tensor, shape (N, m, n)
        Affinity of m clusters to n > m patches.
    dustbin : Tensor, shape ()
        Affinity of every patch to the dustbin.
    n_rounds : int

    Returns
    -------
    shares : Tensor, shape (N, m, n)
    """
    n_pictures, m, n = scores.shape
    table = torch.cat([scores, dustbin.expand(n_pictures, 1, n)], 1)
    taken = torch.zeros(m + 1, dtype=scores.dtype, device=scores.device)
    taken[m] = math.log(n - m)
    taken = taken.expand(n_pictures, -1)
    rows = torch.zeros_like(taken)
    columns = torch.zeros_like(table[:, 0])
    for _ in range(n_rounds):
        rows = taken - torch.logsumexp(table + columns[:, None], 2)
        columns = -torch.logsumexp(table + rows[:, :, None], 1)
    return (table + rows[:, :, None] + columns[:, None])[:, :m].exp()


class _Salad(nn.Module):
    """Patches and the class token to one unit vector."""

    def __init__(self, width: int, cluster_length: int) -> None:
        super().__init__()
        self.token_features = nn.Sequential(
            nn.Linear(width, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, TOKEN_LENGTH)
        )
        self.cluster_features = _pointwise(width, cluster_length)
        self.score = _pointwise(width, N_CLUSTERS)
        self.dust_bin = nn.Parameter(torch.tensor(1.0))

    def forward(self, maps: Tensor, token: Tensor) -> Tensor:
        """Return (N, 256 + 64 * cluster_length)."""
        features = self.cluster_features(maps).flatten(2)
        shares = share_out(self.score(maps).flatten(2), self.dust_bin)
        clusters = functional.normalize(features @ shares.transpose(1, 2), dim=1)
        scene = functional.normalize(self.token_features(token), dim=1)
        return functional.normalize(torch.cat([scene, clusters.flatten(1)], 1), dim=1)


class _Tokens(nn.Module):
    """DINOv2 with its last normalisation, as maps and class token."""

    def __init__(self, model: DinoV2) -> None:
        super().__init__()
        self.model = model

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return (N, width, h, w) and (N, width)."""
        tokens = self.model.norm(self.model(x))
        maps = self.model.maps(tokens, x.shape[2] // PATCH, x.shape[3] // PATCH)
        return maps, tokens[:, 0]


class SaladNet(nn.Module):
    """Descriptors of SALAD, 8448 numbers.

    Parameters
    ----------
    dino : DinoV2, optional
        Default: ViT-B/14, as published.
    """

    def __init__(self, dino: DinoV2 | None = None) -> None:
        super().__init__()
        dino = dino or DinoV2()
        self.backbone = _Tokens(dino)
        self.aggregator = _Salad(dino.width, cluster_length=128)

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors for pictures (N, 3, H, W) of more than 64 patches."""
        vectors: Tensor = self.aggregator(*self.backbone(x))
        return vectors

    def load_named(self, tensors: Mapping[str, Any], owner: str = "salad") -> None:
        """Load an official checkpoint; InputError if it is another network's."""
        load_published(self, tensors, owner, unused=_UNUSED)


class MegaLocNet(nn.Module):
    """Descriptors of MegaLoc, 8448 numbers.

    Parameters
    ----------
    dino : DinoV2, optional
        Default: ViT-B/14, as published.
    dimension : int
        Length of the descriptor.
    """

    def __init__(self, dino: DinoV2 | None = None, dimension: int = 8448) -> None:
        super().__init__()
        dino = dino or DinoV2()
        cluster_length = 256
        self.backbone = _Tokens(dino)
        self.aggregator = nn.ModuleDict(
            {
                "agg": _Salad(dino.width, cluster_length),
                "linear": nn.Linear(TOKEN_LENGTH + N_CLUSTERS * cluster_length, dimension),
            }
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors for pictures (N, 3, H, W) of more than 64 patches."""
        gathered = self.aggregator["agg"](*self.backbone(x))
        return functional.normalize(self.aggregator["linear"](gathered), dim=1)

    def load_named(self, tensors: Mapping[str, Any], owner: str = "megaloc") -> None:
        """Load an official checkpoint; InputError if it is another network's.

        The later release as safetensors names DINOv2 without ``model.`` in between.
        """
        renames = (("backbone.model.", "backbone.model."), ("backbone.", "backbone.model."))
        load_published(self, tensors, owner, renames=renames, unused=_UNUSED)


def _pointwise(width: int, outputs: int) -> nn.Sequential:
    # 1 is the drop-out of training: it keeps the published numbers.
    return nn.Sequential(
        nn.Conv2d(width, HIDDEN, 1), nn.Identity(), nn.ReLU(), nn.Conv2d(HIDDEN, outputs, 1)
    )
