"""What the tests of trainings share: a task of three numbers, a technique of one convolution."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from PIL import Image
from torch import Tensor, nn

from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.training.loop import LoopSettings
from retraverse.types import Array, FloatArray, ImageArray

SIDE = 16
QUICK = LoopSettings(
    steps=12, learning_rate=0.05, warm_up=2, threads=1, checkpoint_every=4, half_precision=False
)


class Line:
    """Find the three numbers of a line from noisy values."""

    def __init__(self, wanted: float = 2.0) -> None:
        torch.manual_seed(3)
        self.network = nn.Linear(3, 1)
        self.wanted = wanted

    def batch(self, step: int, random: np.random.Generator) -> tuple[Tensor, Tensor]:
        x = torch.from_numpy(random.standard_normal((8, 3)).astype(np.float32))
        return x, (x * self.wanted).sum(1, keepdim=True)

    def loss(self, batch: tuple[Tensor, Tensor]) -> Tensor:
        x, wanted = batch
        # Noise by PyTorch's own generator: what a resumed run must draw alike.
        noise = 0.01 * torch.randn(len(x), 1)
        loss: Tensor = (self.network(x) + noise - wanted).square().mean()
        return loss

    def identity(self) -> dict[str, Any]:
        return {"wanted": self.wanted}


class TinyTechnique(LearnedTechnique):
    """One convolution with batch normalisation on 16 x 16 pixels."""

    name: ClassVar[str] = "tiny"
    summary: ClassVar[str] = "for tests"
    citation: ClassVar[str] = "none"
    version: ClassVar[int] = 1
    layout = Layout("global", {"descriptor": ArraySpec((4 * 8 * 8,), "float32")})

    def __init__(self) -> None:
        super().__init__(LearnedParameters())

    def prepare(self, image: ImageArray) -> FloatArray:
        small = Image.fromarray(image).resize((SIDE, SIDE))
        scaled = np.asarray(small, np.float32) / 128 - 1
        return np.ascontiguousarray(scaled.transpose(2, 0, 1), np.float32)

    def network(self) -> nn.Module:
        if self._network is None:
            self._network = self.build_network({})
        return self._network

    def build_network(self, tensors: Mapping[str, Array]) -> nn.Module:
        torch.manual_seed(0)
        network = nn.Sequential(nn.Conv2d(3, 4, 3, 2, 1, bias=False), nn.BatchNorm2d(4), nn.ReLU())
        return network.eval()

    def fingerprint(self) -> str:
        return "tiny"


def pictures(seed: int, count: int = 6, height: int = 60, width: int = 80) -> list[ImageArray]:
    """Return pictures of coarse random colours, as JPEG likes them."""
    print("seed", seed)
    random = np.random.default_rng(seed)
    coarse = random.integers(0, 256, (count, 6, 8, 3), np.uint8)
    return [
        np.asarray(Image.fromarray(one).resize((width, height), Image.Resampling.BICUBIC))
        for one in coarse
    ]


def write_pictures(folder: Path, images: list[ImageArray]) -> Path:
    """Write pictures as PNG into a new folder."""
    folder.mkdir(parents=True)
    for number, image in enumerate(images):
        Image.fromarray(image).save(folder / f"{number:03d}.png")
    return folder
