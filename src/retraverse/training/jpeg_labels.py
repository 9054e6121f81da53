"""A network that does not mind JPEG, tuned by classes as in the thesis.

The network of a technique gets a small classifier on its pooled output and learns the classes of
a folder (one folder of pictures each) from pictures compressed at c = 97; the classifier is thrown
away afterwards. What helps to name six kinds of scene need not help to tell one stretch of a
corridor from the next: compare with `jpeg_distil`, which needs no classes.

References
----------
The thesis' chapter 5, section 5.4.1: AlexNet trained on Places365, then tuned on the same pictures
compressed at 97 %; what it describes places by is the layer fc6.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import ConfigError
from retraverse.techniques.running.learned import LearnedTechnique
from retraverse.training.folding import unfolded_state
from retraverse.training.loop import LoopSettings, run_loop
from retraverse.training.outcome import Outcome, write_outcome
from retraverse.training.pictures import (
    CompressionMix,
    LabelledPictures,
    ViewSettings,
    draw_view,
    labelled_pictures,
    seen_through_jpeg,
    take_view,
)
from retraverse.training.tuned_network import as_input, learned_technique, tunable
from retraverse.types import Progress, no_progress

__all__ = ["Classifier", "JpegLabels", "LabelSettings", "train_jpeg_labels"]

THESIS_COMPRESSION = 97
_GRID = 4


@dataclass(frozen=True)
class LabelSettings:
    """How a network is tuned by classes."""

    technique: str = "efficientnet"
    """Whose network; any with a PyTorch network."""
    pictures: int = 32
    """In a batch."""
    mix: CompressionMix = field(
        default_factory=lambda: CompressionMix(
            clean=0.0, bands=((1.0, THESIS_COMPRESSION, THESIS_COMPRESSION),)
        )
    )
    view: ViewSettings = field(default_factory=ViewSettings)
    loop: LoopSettings = field(
        default_factory=lambda: LoopSettings(steps=300, learning_rate=1e-4, averaging=0.98)
    )

    def __post_init__(self) -> None:
        """Check the size of a batch."""
        if self.pictures < 2:
            raise ConfigError(f"pictures: got {self.pictures}, expected at least 2")


class Classifier(nn.Module):
    """A network, and one linear layer on its maps' means over a grid of 4 x 4.

    The grid keeps where in the picture something is, as the thesis' fc6 does: what places are
    told apart by must not be unlearned.

    Parameters
    ----------
    network : nn.Module
        Gives (N, C, H, W) or (N, C).
    channels : int
        C.
    n_classes : int
    is_map : bool
        Whether it gives (N, C, H, W).
    """

    def __init__(
        self, network: nn.Module, channels: int, n_classes: int, *, is_map: bool = True
    ) -> None:
        super().__init__()
        self.network = network
        self.classes = nn.Linear(channels * (_GRID**2 if is_map else 1), n_classes)
        # At first no class is preferred, so that the network's own weights are not shaken.
        nn.init.zeros_(self.classes.weight)
        nn.init.zeros_(self.classes.bias)

    def forward(self, x: Tensor) -> Tensor:
        """Return the classes' scores, (N, n_classes)."""
        features = self.network(x)
        if features.ndim == 4:
            features = functional.adaptive_avg_pool2d(features, _GRID)
        pooled = features.flatten(1)
        scores: Tensor = self.classes(functional.normalize(pooled, dim=1) * pooled.shape[1] ** 0.5)
        return scores


class JpegLabels:
    """The task: see the module."""

    def __init__(
        self, technique: LearnedTechnique, shown: LabelledPictures, settings: LabelSettings
    ) -> None:
        self.technique = technique
        self.settings = settings
        self._shown = shown
        network = tunable(technique.network())
        shape = _output_shape(technique)
        is_map = len(shape) == 4
        self.network = Classifier(network, shape[1], len(shown.classes), is_map=is_map)

    def batch(self, step: int, random: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Return compressed pictures as the network takes them, and their classes."""
        chosen = random.integers(0, len(self._shown.pictures), self.settings.pictures)
        pictures, labels = [], []
        for number in chosen:
            picture = self._shown.pictures[number]
            view = draw_view(random, picture.shape[:2], self.settings.view)
            seen = take_view(picture, view, random)
            pictures.append(seen_through_jpeg(seen, self.settings.mix.draw(random)))
            labels.append(self._shown.labels[number])
        return as_input(self.technique, pictures), torch.tensor(labels)

    def loss(self, batch: tuple[Tensor, Tensor]) -> Tensor:
        """Return the mean cross entropy."""
        pictures, labels = batch
        return functional.cross_entropy(self.network(pictures).float(), labels)

    def identity(self) -> dict[str, Any]:
        """Return settings, weights, classes and number of pictures."""
        settings = asdict(self.settings)
        del settings["loop"]
        about = {"classes": list(self._shown.classes), "n": len(self._shown.pictures)}
        return {**settings, "weights": self.technique.fingerprint(), **about}


def train_jpeg_labels(
    source: Path,
    folder: Path,
    settings: LabelSettings | None = None,
    *,
    check: Path | None = None,
    limit: int = 0,
    resume: bool = False,
    parameters: dict[str, object] | None = None,
    progress: Progress = no_progress,
) -> Outcome:
    """Tune a technique's network by classes; write weights, summary and page to a folder.

    Parameters
    ----------
    source : Path
        One folder of pictures a class.
    folder : Path
        Where everything goes; made if need be.
    settings : LabelSettings, optional
    check : Path, optional
        Other pictures of the same classes: how many are named right at c = 97.
    limit : int
        Take so many pictures at most; 0 = all.
    resume : bool
        Go on from the folder's checkpoint.
    parameters : dict, optional
        Of the technique: its block, say.
    progress : Progress

    Raises
    ------
    DataMissingError
        If there are no pictures, or the technique's weights are not here.
    ConfigError, InputError
        If settings do not fit, there are fewer than two classes, or the folder holds another
        training.
    """
    settings = settings or LabelSettings()
    technique = learned_technique(settings.technique, parameters or {})
    shown = labelled_pictures(source, limit=limit, progress=progress)
    task = JpegLabels(technique, shown, settings)
    folder.mkdir(parents=True, exist_ok=True)
    trained = run_loop(task, settings.loop, folder, resume=resume, progress=progress)
    classifier = trained.network
    assert isinstance(classifier, Classifier)
    figures = {}
    if check is not None:
        held_out = labelled_pictures(check, progress=progress)
        figures["named right at c = 97"] = _share_named(technique, classifier, held_out)
    return write_outcome(
        folder,
        title=f"{settings.technique} tuned by classes on compressed pictures",
        tensors=unfolded_state(classifier.network, technique.network()),
        trained=trained,
        settings=settings,
        source=f"{len(shown.pictures)} pictures of {len(shown.classes)} classes of {source.name}",
        figures=figures,
    )


def _output_shape(technique: LearnedTechnique) -> tuple[int, ...]:
    """Return the shape of the network's output for one picture."""
    with torch.no_grad():
        output = technique.network()(torch.zeros(1, *technique.input_shape()))
    return tuple(output.shape)


@torch.inference_mode()
def _share_named(
    technique: LearnedTechnique, classifier: Classifier, shown: LabelledPictures
) -> float:
    right = 0
    for picture, label in zip(shown.pictures, shown.labels, strict=True):
        seen = seen_through_jpeg(picture, THESIS_COMPRESSION)
        right += int(classifier(as_input(technique, [seen])).argmax()) == label
    return right / max(1, len(shown.labels))
