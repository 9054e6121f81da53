"""The published networks once more, slowly: straight from a checkpoint's names, no modules."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812

from retraverse.types import Array


class Checkpoint:
    """A checkpoint's arrays as tensors, by name."""

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._tensors = {name: torch.from_numpy(np.asarray(a)) for name, a in arrays.items()}

    def __getitem__(self, name: str) -> Tensor:
        return self._tensors[name]

    def __contains__(self, name: str) -> bool:
        return name in self._tensors

    def linear(self, name: str, x: Tensor) -> Tensor:
        return x @ self[f"{name}.weight"].flatten(1).T + self[f"{name}.bias"]

    def layer_norm(self, name: str, x: Tensor, eps: float) -> Tensor:
        centred = x - x.mean(-1, keepdim=True)
        scaled = centred / (centred.pow(2).mean(-1, keepdim=True) + eps).sqrt()
        return scaled * self[f"{name}.weight"] + self[f"{name}.bias"]

    def batch_norm(self, name: str, x: Tensor) -> Tensor:
        mean, variance, weight, bias = (
            self[f"{name}.{part}"][:, None, None]
            for part in ("running_mean", "running_var", "weight", "bias")
        )
        return (x - mean) / (variance + 1e-5).sqrt() * weight + bias


def resnet(c: Checkpoint, names: list[str], x: Tensor) -> Tensor:
    """Return the maps after some stages; the first two of `names` are convolution and norm."""
    conv1, bn1, *stages = names
    x = F.relu(c.batch_norm(bn1, F.conv2d(x, c[f"{conv1}.weight"], stride=2, padding=3)))
    x = F.max_pool2d(x, 3, 2, 1)
    for number, stage in enumerate(stages):
        block = 0
        while f"{stage}.{block}.conv1.weight" in c:
            x = _block(c, f"{stage}.{block}", x, 2 if number and not block else 1)
            block += 1
    return x


def _block(c: Checkpoint, name: str, x: Tensor, stride: int) -> Tensor:
    deep = f"{name}.conv3.weight" in c
    strides = (1, stride, 1) if deep else (stride, 1)
    y = x
    for number, step in enumerate(strides, 1):
        kernel = c[f"{name}.conv{number}.weight"]
        y = F.conv2d(y, kernel, stride=step, padding=kernel.shape[-1] // 2)
        y = c.batch_norm(f"{name}.bn{number}", y)
        if number < len(strides):
            y = F.relu(y)
    if f"{name}.downsample.0.weight" in c:
        x = F.conv2d(x, c[f"{name}.downsample.0.weight"], stride=stride)
        x = c.batch_norm(f"{name}.downsample.1", x)
    return F.relu(x + y)


def vgg16(c: Checkpoint, prefix: str, x: Tensor) -> Tensor:
    """Return conv5_3 before its ReLU."""
    for place in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28):
        if place in (5, 10, 17, 24):
            x = F.max_pool2d(x, 2)
        x = F.conv2d(x, c[f"{prefix}.{place}.weight"], c[f"{prefix}.{place}.bias"], padding=1)
        if place != 28:
            x = F.relu(x)
    return x


def geo(c: Checkpoint, maps: Tensor) -> Tensor:
    """Return CosPlace's aggregation of maps."""
    maps = maps / maps.pow(2).sum(1, keepdim=True).sqrt().clamp(min=1e-12)
    p = c["aggregation.1.p"]
    pooled = maps.clamp(min=1e-6).pow(p).flatten(2).mean(2).pow(1 / p)
    return unit(c.linear("aggregation.3", pooled))


def unit(x: Tensor) -> Tensor:
    return x / x.pow(2).sum(1, keepdim=True).sqrt()


def dinov2(c: Checkpoint, prefix: str, x: Tensor, heads: int) -> Tensor:
    """Return the tokens before the last norm, for pictures of the trained size."""
    patches = F.conv2d(x, c[f"{prefix}.patch_embed.proj.weight"], stride=14)
    patches = patches + c[f"{prefix}.patch_embed.proj.bias"][:, None, None]
    tokens = patches.flatten(2).permute(0, 2, 1)
    first = c[f"{prefix}.cls_token"].repeat(len(x), 1, 1)
    x = torch.cat([first, tokens], 1) + c[f"{prefix}.pos_embed"]
    block = 0
    while f"{prefix}.blocks.{block}.norm1.weight" in c:
        name = f"{prefix}.blocks.{block}"
        y = c.layer_norm(f"{name}.norm1", x, 1e-6)
        query, key, value = c.linear(f"{name}.attn.qkv", y).chunk(3, -1)
        parts = []
        for q, k, v in zip(*(t.chunk(heads, -1) for t in (query, key, value)), strict=True):
            scores = q @ k.transpose(1, 2) / q.shape[-1] ** 0.5
            parts.append(scores.softmax(-1) @ v)
        x = x + c[f"{name}.ls1.gamma"] * c.linear(f"{name}.attn.proj", torch.cat(parts, -1))
        y = c.layer_norm(f"{name}.norm2", x, 1e-6)
        hidden = F.gelu(c.linear(f"{name}.mlp.fc1", y))
        x = x + c[f"{name}.ls2.gamma"] * c.linear(f"{name}.mlp.fc2", hidden)
        block += 1
    return x


def salad(c: Checkpoint, prefix: str, tokens: Tensor) -> Tensor:
    """Return SALAD's aggregation of normalised tokens; Sinkhorn without logarithms, float64."""
    token, patches = tokens[:, 0], tokens[:, 1:]

    def mlp(name: str, x: Tensor, last: int) -> Tensor:
        return c.linear(f"{name}.{last}", F.relu(c.linear(f"{name}.0", x)))

    scene = unit(mlp(f"{prefix}.token_features", token, 2))
    features = mlp(f"{prefix}.cluster_features", patches, 3)
    scores = mlp(f"{prefix}.score", patches, 3).double()
    n_clusters, n_patches = scores.shape[2], scores.shape[1]
    table = torch.cat(
        [scores, c[f"{prefix}.dust_bin"].double().expand(len(scores), n_patches, 1)], 2
    ).exp()
    wanted = torch.ones(n_clusters + 1, dtype=torch.float64)
    wanted[-1] = n_patches - n_clusters
    for _ in range(3):
        table = table / table.sum(1, keepdim=True) * wanted
        table = table / table.sum(2, keepdim=True)
    shares = table[:, :, :n_clusters].float()
    clusters = unit(torch.einsum("npl,npm->nlm", features, shares))
    return unit(torch.cat([scene, clusters.flatten(1)], 1))
