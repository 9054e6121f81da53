"""DINOv2's vision transformer with patches of 14 x 14: tokens of a picture.

Conventions
- Input is float32 (N, 3, H, W), H and W multiples of 14, RGB, ImageNet's mean and deviation.
- Names of parameters are those of the published weights (``blocks.0.attn.qkv.weight``).

References
----------
Oquab, Darcet, Moutakanni et al.: DINOv2: Learning Robust Visual Features without Supervision,
TMLR 2024. Dosovitskiy, Beyer, Kolesnikov et al.: An Image is Worth 16x16 Words, ICLR 2021.
Touvron, Cord, Sablayrolles et al.: Going Deeper with Image Transformers, ICCV 2021 (LayerScale).
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["BASE", "PATCH", "DinoV2"]

PATCH = 14
BASE = {"width": 768, "depth": 12, "heads": 12}
"""The size called ViT-B/14."""
_TRAINED_GRID = 37
"""Patches a side that positions were learned for: 518 pixels."""
_OFFSET = 0.1
"""Added to the number of patches when positions are resampled, as the published weights expect."""


class _Attention(nn.Module):
    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self._heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, T, width)."""
        n, tokens, width = x.shape
        parts = self.qkv(x).reshape(n, tokens, 3, self._heads, width // self._heads)
        query, key, value = parts.permute(2, 0, 3, 1, 4)
        heard = functional.scaled_dot_product_attention(query, key, value)
        mixed: Tensor = self.proj(heard.transpose(1, 2).reshape(n, tokens, width))
        return mixed


class _Scale(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.gamma = nn.Parameter(torch.ones(width))

    def forward(self, x: Tensor) -> Tensor:
        """Return every channel times its factor."""
        return x * self.gamma


class _Perceptron(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.fc1 = nn.Linear(width, 4 * width)
        self.fc2 = nn.Linear(4 * width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, T, width)."""
        widened: Tensor = self.fc2(functional.gelu(self.fc1(x)))
        return widened


class _Block(nn.Module):
    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(width, eps=1e-6)
        self.attn = _Attention(width, heads)
        self.ls1 = _Scale(width)
        self.norm2 = nn.LayerNorm(width, eps=1e-6)
        self.mlp = _Perceptron(width)
        self.ls2 = _Scale(width)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, T, width)."""
        x = x + self.ls1(self.attn(self.norm1(x)))
        y: Tensor = x + self.ls2(self.mlp(self.norm2(x)))
        return y


class DinoV2(nn.Module):
    """Tokens of a picture.

    Parameters
    ----------
    width, depth, heads : int
        Default: ViT-B/14.
    grid : int
        Patches a side that positions are stored for.
    """

    def __init__(
        self, width: int = 768, depth: int = 12, heads: int = 12, grid: int = _TRAINED_GRID
    ) -> None:
        super().__init__()
        self.width = width
        self._grid = grid
        self.cls_token = nn.Parameter(torch.zeros(1, 1, width))
        self.pos_embed = nn.Parameter(torch.zeros(1, 1 + grid * grid, width))
        self.patch_embed = nn.ModuleDict({"proj": nn.Conv2d(3, width, PATCH, PATCH)})
        self.blocks = nn.ModuleList(_Block(width, heads) for _ in range(depth))
        self.norm = nn.LayerNorm(width, eps=1e-6)

    def forward(self, x: Tensor) -> Tensor:
        """Return the tokens before the last normalisation, (N, 1 + h w, width); first the class."""
        height, width = x.shape[2] // PATCH, x.shape[3] // PATCH
        patches = self.patch_embed["proj"](x).flatten(2).transpose(1, 2)
        # Not len(x): an exported graph would then take batches of one size only.
        tokens = torch.cat([self.cls_token.expand(x.shape[0], -1, -1), patches], 1)
        tokens = tokens + self._positions(height, width)
        for block in self.blocks:
            tokens = block(tokens)
        return tokens

    def maps(self, tokens: Tensor, height: int, width: int) -> Tensor:
        """Return the tokens of the patches as maps, (N, width, h, w)."""
        patches = tokens[:, 1:].transpose(1, 2)
        return patches.reshape(tokens.shape[0], self.width, height, width)

    def _positions(self, height: int, width: int) -> Tensor:
        """Return the learned positions, resampled to the picture's grid."""
        if height == width == self._grid:
            return self.pos_embed
        grid = self.pos_embed[:, 1:].reshape(1, self._grid, self._grid, self.width)
        factors = ((height + _OFFSET) / self._grid, (width + _OFFSET) / self._grid)
        resampled = functional.interpolate(
            grid.permute(0, 3, 1, 2), scale_factor=factors, mode="bicubic"
        )
        return torch.cat([self.pos_embed[:, :1], resampled.flatten(2).transpose(1, 2)], 1)
