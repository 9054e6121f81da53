"""A learned technique with a network of two layers, for tests: seeded weights, made in a moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from safetensors.numpy import save_file

from retraverse.techniques import ArraySpec, Layout
from retraverse.techniques.parameters import parameter
from retraverse.techniques.preparing.network_input import channels_first, resized
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.types import Array, FloatArray, ImageArray

__all__ = ["TinyParameters", "TinyTechnique", "pictures", "write_tiny_weights"]

SIDE = 24


@dataclass(frozen=True)
class TinyParameters(LearnedParameters):
    weights: str = parameter("tiny", "name or path", compared=False)
    scale: float = parameter(1.0, "what pixels are divided by")


class TinyNetwork(torch.nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.conv = torch.nn.Conv2d(3, 8, 5, 2)
        self.norm = torch.nn.BatchNorm2d(8)
        self.last = torch.nn.Conv2d(8, 6, 3)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.last(torch.relu(self.norm(self.conv(x))))  # type: ignore[no-any-return]


class TinyTechnique(LearnedTechnique):
    name: ClassVar[str] = "tiny"
    summary: ClassVar[str] = "for tests"
    citation: ClassVar[str] = "none, none"
    version: ClassVar[int] = 1

    def __init__(self, parameters: TinyParameters | None = None) -> None:
        super().__init__(parameters or TinyParameters())
        self.layout = Layout("global", {"descriptor": ArraySpec((6 * 8 * 8,), "float32")})

    def prepare(self, image: ImageArray) -> FloatArray:
        return channels_first(resized(image, SIDE, SIDE)) / np.float32(255 * self.parameters.scale)

    def build_network(self, tensors: Mapping[str, Array]) -> torch.nn.Module:
        network = TinyNetwork()
        network.load_state_dict({name: torch.from_numpy(tensors[name]) for name in tensors})
        return network


def write_tiny_weights(path: Path, seed: int = 0) -> Path:
    """Write seeded weights and return where they are."""
    torch.manual_seed(seed)
    network = TinyNetwork()
    with torch.no_grad():
        network.norm.load_state_dict(
            {
                "running_mean": torch.empty(8).uniform_(-1, 1),
                "running_var": torch.empty(8).uniform_(0.5, 2),
            },
            strict=False,
        )
    save_file({name: value.numpy() for name, value in network.state_dict().items()}, path)
    return path


def pictures(count: int) -> list[ImageArray]:
    """Return textured pictures, seeded."""
    random = np.random.default_rng(3)
    coarse = random.integers(0, 256, (count, 6, 8, 3)).astype(np.uint8)
    return [np.kron(one, np.ones((8, 8, 1), np.uint8)) for one in coarse]
