"""CALC's autoencoder: a small encoder learns to give the HOG of the same place seen otherwise.

Each picture is looked at twice through random projective warps, as from two places; from one look
the network must rebuild the HOG descriptor of the other. The encoder is kept, its 1064 numbers are
CALC's descriptor; the decoder is thrown away.

Conventions
- Looks are grey, luminance equalised, 160 x 120, 0..1, as the technique `calc` prepares pictures.
- HOG has 3648 numbers: windows of 16 x 32 pixels every 8, cells of 8 x 8 in blocks of 16 x 16
  side by side, two signless directions.
- The decoder: two hidden layers of 2048 with sigmoids, one linear layer. Optimised by AdamW where
  the paper uses SGD with momentum.

References
----------
Merrill, Huang: Lightweight Unsupervised Deep Loop Closure, RSS 2018, section IV.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import ConfigError
from retraverse.images import Traverse
from retraverse.techniques.networks.caffe_net import CaffeNet, seeded_tensors
from retraverse.techniques.networks.caffe_tables import CALC, graph_of, output_shape
from retraverse.techniques.preparing.caffe_input import cubic, equalised
from retraverse.training.loop import LoopSettings, run_loop
from retraverse.training.outcome import Outcome, write_outcome
from retraverse.training.pictures import load_pictures
from retraverse.types import FloatArray, ImageArray, Progress, no_progress

__all__ = ["Calc", "CalcSettings", "encoder_tensors", "hog_of", "random_warp", "train_calc"]

INPUT = (1, 120, 160)
N_HOG = 3648


@dataclass(frozen=True)
class CalcSettings:
    """How the autoencoder is trained."""

    pictures: int = 32
    """In a batch."""
    warp: float = 0.15
    """How far corners are moved at most, as a share of the picture's sides."""
    hidden: int = 2048
    """Width of the decoder's hidden layers."""
    loop: LoopSettings = field(
        default_factory=lambda: LoopSettings(steps=3000, learning_rate=5e-4, half_precision=False)
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("pictures", "hidden"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: got {getattr(self, name)}, expected at least 1")
        if not 0 < self.warp < 0.5:
            raise ConfigError(f"warp: got {self.warp}, expected 0 to 0.5")


class _Autoencoder(nn.Module):
    """CALC's encoder and a decoder to HOG."""

    def __init__(self, seed: int, hidden: int) -> None:
        super().__init__()
        torch.manual_seed(seed)
        graph = graph_of(CALC, INPUT, "CALC")
        self.encoder = CaffeNet(graph, seeded_tensors(graph, seed))
        self.encoder.requires_grad_(True)
        length = int(np.prod(output_shape(CALC, INPUT)))
        self.decoder = nn.Sequential(
            nn.Flatten(), nn.Linear(length, hidden), nn.Sigmoid(),
            nn.Linear(hidden, hidden), nn.Sigmoid(), nn.Linear(hidden, N_HOG),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        """Return HOG descriptors (N, 3648) of looks (N, 1, 120, 160)."""
        rebuilt: Tensor = self.decoder(self.encoder(x))
        return rebuilt


class Calc:
    """The task: see the module."""

    def __init__(self, pictures: Sequence[ImageArray], settings: CalcSettings) -> None:
        self.settings = settings
        self._looks = [_grey(picture) for picture in pictures]
        self.network = _Autoencoder(settings.loop.seed, settings.hidden)

    def batch(self, step: int, random: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Return first looks, and the HOG of second looks."""
        chosen = random.integers(0, len(self._looks), self.settings.pictures)
        first, second = [], []
        for number in chosen:
            look = self._looks[number]
            first.append(random_warp(look, self.settings.warp, random))
            second.append(hog_of(random_warp(look, self.settings.warp, random)))
        looks = np.stack(first)[:, np.newaxis].astype(np.float32) / 255
        return torch.from_numpy(looks), torch.from_numpy(np.stack(second))

    def loss(self, batch: tuple[Tensor, Tensor]) -> Tensor:
        """Return half the squared distance to the HOG, mean over the batch (Caffe's own)."""
        looks, wanted = batch
        distance: Tensor = (self.network(looks).float() - wanted).square().sum(dim=1)
        return distance.mean() / 2

    def identity(self) -> dict[str, Any]:
        """Return settings and number of pictures."""
        settings = asdict(self.settings)
        del settings["loop"]
        return {**settings, "n": len(self._looks)}


def hog_of(grey: ImageArray) -> FloatArray:
    """Return the HOG of a grey picture of 160 x 120, float32 (3648,)."""
    descriptor = cv2.HOGDescriptor((16, 32), (16, 16), (16, 16), (8, 8), 2)
    values = descriptor.compute(grey, winStride=(8, 8), padding=(0, 0))
    return np.asarray(values, np.float32).ravel()


def random_warp(picture: ImageArray, largest: float, random: np.random.Generator) -> ImageArray:
    """Return the picture as from another place: its corners moved inwards, projectively.

    Parameters
    ----------
    picture : uint8 array
    largest : float
        Share of the sides that a corner moves at most.
    random : Generator
    """
    height, width = picture.shape[:2]
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    inwards = np.where(corners > 0, -1, 1) * random.uniform(0, largest, (4, 2))
    size = np.array([width - 1, height - 1], np.float32)
    source = np.asarray((corners + inwards) * size, np.float32)
    warp = cv2.getPerspectiveTransform(source, corners * size)
    return np.asarray(cv2.warpPerspective(picture, warp, (width, height)), np.uint8)


def encoder_tensors(encoder: CaffeNet) -> dict[str, Tensor]:
    """Return the encoder's weights by their Caffe names: ``conv1.0`` weight, ``conv1.1`` bias."""
    return {
        f"{layer.name}.{number}": tensor
        for layer, step in zip(CALC, encoder.steps, strict=True)
        for number, tensor in enumerate(step.state_dict().values())
    }


def train_calc(
    source: Path | str | Traverse,
    folder: Path,
    settings: CalcSettings | None = None,
    *,
    limit: int = 0,
    resume: bool = False,
    progress: Progress = no_progress,
) -> Outcome:
    """Train CALC's encoder; write weights, summary and page to a folder.

    Parameters
    ----------
    source : Path, str or Traverse
        Pictures: a folder (of folders), or any drive.
    folder : Path
        Where everything goes; made if need be.
    settings : CalcSettings, optional
    limit : int
        Take so many pictures at most; 0 = all.
    resume : bool
        Go on from the folder's checkpoint.
    progress : Progress

    Raises
    ------
    DataMissingError
        If there are no pictures.
    InputError
        If the folder holds another training.
    """
    settings = settings or CalcSettings()
    pictures = load_pictures(source, limit=limit, progress=progress)
    task = Calc(pictures, settings)
    folder.mkdir(parents=True, exist_ok=True)
    trained = run_loop(task, settings.loop, folder, resume=resume, progress=progress)
    network = trained.network
    assert isinstance(network, _Autoencoder)
    return write_outcome(
        folder,
        title="CALC's encoder",
        tensors=encoder_tensors(network.encoder),
        trained=trained,
        settings=settings,
        source=f"{len(pictures)} pictures of {Path(getattr(source, 'source', str(source))).name}",
        figures={},
        half=False,
    )


def _grey(picture: ImageArray) -> ImageArray:
    """Return the picture as CALC looks at it, uint8 (120, 160)."""
    grey = np.asarray(cv2.cvtColor(equalised(picture), cv2.COLOR_RGB2GRAY), np.uint8)
    _, height, width = INPUT
    return np.clip(np.rint(cubic(grey, height, width)), 0, 255).astype(np.uint8)
