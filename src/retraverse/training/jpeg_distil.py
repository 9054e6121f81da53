"""A network that does not mind JPEG, learned without labels.

The network on the compressed picture learns to give what the frozen original gives on the clean
one. What the network knows of places is kept, since the original says what to answer. Any pictures
will do, and the best are those of the map's own drive: begun with ``"jpeg"``, the weights that come
with this program, some minutes on the map's clean pictures make the network expect this very route
(docs/jpeg-tuned.md).

Conventions
- A batch is `pictures` pictures, each in `views` neighbouring views (as the frames of a drive
  are), each of those in `copies` compressions.
- The loss of one output: one minus the cosine of the whole outputs; the same at every position,
  averaged; the same less the batch's mean output; and how much the similarities of a copy with
  all clean views of the batch differ from those of the clean view itself (Kullback-Leibler
  divergence of their softmax). The first is what a map compares by, the second keeps weak
  positions from being neglected, the other two keep places and neighbours apart.

References
----------
Hinton, Vinyals, Dean: Distilling the Knowledge in a Neural Network, 2015; Tung, Mori:
Similarity-Preserving Knowledge Distillation, ICCV 2019. The question is that of the thesis'
chapter 5, which tunes by labels; see `jpeg_labels`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from retraverse.errors import ConfigError
from retraverse.images import Traverse
from retraverse.techniques.running.file_digest import file_digest
from retraverse.techniques.running.learned import LearnedTechnique
from retraverse.training.folding import folded, unfolded_state
from retraverse.training.loop import LoopSettings, run_loop
from retraverse.training.outcome import Outcome, write_outcome
from retraverse.training.pictures import (
    CompressionMix,
    ViewSettings,
    draw_view,
    load_pictures,
    nearby_view,
    seen_through_jpeg,
    take_view,
)
from retraverse.training.proxy import retrieval_figures
from retraverse.training.tuned_network import Outputs, as_input, learned_technique, tunable
from retraverse.types import ImageArray, Progress, no_progress
from retraverse.weights.records import is_name

__all__ = ["DistilSettings", "JpegDistil", "distil_loss", "scaled_views", "train_jpeg_distil"]


_INNER_BLOCK = 7
"""Of EfficientNet-Lite0: the last one before its positions become four times fewer and deeper."""


@dataclass(frozen=True)
class DistilSettings:
    """How a network is tuned without labels."""

    technique: str = "efficientnet"
    """Whose network; any with a PyTorch network."""
    inner: tuple[str, ...] | None = None
    """Modules inside the network that are matched too, with half the weight; None = block 7 of
    EfficientNet-Lite0, for other networks none."""
    frozen: tuple[str, ...] = ()
    """Modules that do not learn, such as ``"_conv_stem"``."""
    pictures: int = 8
    """Different pictures in a batch."""
    views: int = 2
    """Neighbouring views of each."""
    copies: int = 2
    """Compressions of each view."""
    small_share: float = 0.8
    """Share of the steps, from the first, in which the network takes smaller pictures."""
    small_size: int = 160
    """Side in pixels of what it takes then; half the time of 224. Views are smaller in the same
    measure, so that a block of JPEG is as large to the network as it will be."""
    whole: float = 1.0
    """Weight of the cosine of whole outputs."""
    position: float = 1.0
    """Weight of the mean cosine of positions."""
    centred: float = 1.0
    """Weight of the cosine of whole outputs less the batch's mean: what tells places apart."""
    similarity: float = 0.3
    """Weight of the batch's similarities."""
    temperature: float = 0.05
    """Differences of similarity that count are of this size."""
    mix: CompressionMix = field(
        default_factory=lambda: CompressionMix(
            clean=0.05, bands=((0.65, 95, 99), (0.25, 85, 94), (0.1, 40, 84))
        )
    )
    """Mostly strong: clean pictures are left to the original, see `jpeg_traces`."""
    view: ViewSettings = field(default_factory=ViewSettings)
    loop: LoopSettings = field(
        default_factory=lambda: LoopSettings(steps=1400, learning_rate=1e-3, averaging=0.99)
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("pictures", "views", "copies"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: got {getattr(self, name)}, expected at least 1")
        if not 0 <= self.small_share <= 1:
            raise ConfigError(f"small_share: got {self.small_share}, expected 0 to 1")
        if self.temperature <= 0:
            raise ConfigError(f"temperature: got {self.temperature}, expected more than 0")


@dataclass(frozen=True)
class _Batch:
    """Clean views (N, C, H, W), and their compressed copies (N * copies, C, H, W)."""

    clean: Tensor
    compressed: Tensor


class JpegDistil:
    """The task: see the module. `technique` gives the network, `pictures` are RGB."""

    def __init__(
        self,
        technique: LearnedTechnique,
        pictures: Sequence[ImageArray],
        settings: DistilSettings,
        start: Path | str | None = None,
    ) -> None:
        if len(pictures) < settings.pictures:
            raise ConfigError(
                f"got {len(pictures)} pictures to train on, expected at least the "
                f"{settings.pictures} of one batch"
            )
        inner = _inner_modules(technique, settings)
        self.technique = technique
        self._smaller = _smaller(technique, settings)
        self._smaller_view = scaled_views(settings.view, self._smaller, technique)
        self.settings = settings
        self._pictures = pictures
        begun = technique if start is None else _with_weights(technique, start)
        first = begun.network()
        self._start = "" if start is None else file_digest(begun.weights_path())
        learning = tunable(first, settings.frozen)
        self.network = Outputs(learning, inner)
        self._original = Outputs(folded(technique.network()).requires_grad_(False), inner)
        self._weights = [0.5] * len(inner) + [1.0]

    def batch(self, step: int, random: np.random.Generator) -> _Batch:
        """Return the batch of a step."""
        small = step < self.settings.small_share * self.settings.loop.steps
        technique = self._smaller if small else self.technique
        views = self._smaller_view if small else self.settings.view
        chosen = random.choice(len(self._pictures), self.settings.pictures, replace=False)
        clean: list[ImageArray] = []
        compressed: list[ImageArray] = []
        for number in chosen:
            picture = self._pictures[number]
            first = draw_view(random, picture.shape[:2], views)
            for turn in range(self.settings.views):
                view = nearby_view(random, first, picture.shape[:2]) if turn else first
                seen = take_view(picture, view, random)
                clean.append(seen)
                compressed += [
                    seen_through_jpeg(seen, self.settings.mix.draw(random))
                    for _ in range(self.settings.copies)
                ]
        return _Batch(as_input(technique, clean), as_input(technique, compressed))

    def loss(self, batch: _Batch) -> Tensor:
        """Return the weighted sum over the outputs."""
        with torch.no_grad():
            wanted = self._original(batch.clean)
        got = self.network(batch.compressed)
        losses = [
            weight * distil_loss(ours, theirs, self.settings)
            for weight, ours, theirs in zip(self._weights, got, wanted, strict=True)
        ]
        return torch.stack(losses).sum()

    def identity(self) -> dict[str, Any]:
        """Return settings, weights and number of pictures."""
        settings = asdict(self.settings)
        del settings["loop"]
        about = {"weights": self.technique.fingerprint(), "start": self._start}
        return {**settings, **about, "n": len(self._pictures)}


def _with_weights(technique: LearnedTechnique, weights: Path | str) -> LearnedTechnique:
    """Return the technique with other weights: a file, or a name as its parameters take it."""
    return type(technique)(replace(technique.parameters, weights=str(weights)))


def _inner_modules(technique: LearnedTechnique, settings: DistilSettings) -> tuple[str, ...]:
    if settings.inner is not None:
        return settings.inner
    is_later = technique.name == "efficientnet" and technique.parameters.block > _INNER_BLOCK
    return (f"_blocks.{_INNER_BLOCK}",) if is_later else ()


def _smaller(technique: LearnedTechnique, settings: DistilSettings) -> LearnedTechnique:
    """Return the technique with smaller pictures, or as it is where their size is fixed."""
    parameters = technique.parameters
    if getattr(parameters, "resolution", 0) <= settings.small_size:
        return technique
    return type(technique)(replace(parameters, resolution=settings.small_size))


def scaled_views(
    view: ViewSettings, smaller: LearnedTechnique, technique: LearnedTechnique
) -> ViewSettings:
    """Return views smaller by as much as the smaller technique's pictures are."""
    scale = smaller.input_shape()[1] / technique.input_shape()[1]
    low, high = (max(8, round(width * scale)) for width in view.widths)
    return replace(view, widths=(low, high))


def distil_loss(ours: Tensor, theirs: Tensor, settings: DistilSettings) -> Tensor:
    """Return the loss of one output.

    Parameters
    ----------
    ours : Tensor, shape (N * copies, C, h, w) or (N * copies, D)
        Of the compressed copies; those of one view stand together.
    theirs : Tensor, shape (N, C, h, w) or (N, D)
        Of the clean views, by the original.
    settings : DistilSettings
    """
    copies = len(ours) // len(theirs)
    ours, theirs = ours.float(), theirs.float()
    wanted = theirs.repeat_interleave(copies, 0)
    loss = settings.whole * (1 - functional.cosine_similarity(ours.flatten(1), wanted.flatten(1)))
    if settings.position and ours.ndim == 4:
        here = functional.cosine_similarity(ours, wanted, dim=1)
        loss = loss + settings.position * (1 - here.mean(dim=(1, 2)))
    if settings.centred:
        mean = theirs.mean(dim=0)
        apart = functional.cosine_similarity((ours - mean).flatten(1), (wanted - mean).flatten(1))
        loss = loss + settings.centred * (1 - apart)
    total = loss.mean()
    if settings.similarity:
        total = total + settings.similarity * _similarity_loss(ours, theirs, copies, settings)
    return total


def _similarity_loss(ours: Tensor, theirs: Tensor, copies: int, settings: DistilSettings) -> Tensor:
    """Return how far the copies' similarities with the clean views are from the views' own."""
    clean = functional.normalize(theirs.flatten(1))
    got = functional.normalize(ours.flatten(1)) @ clean.T / settings.temperature
    wanted = (clean @ clean.T / settings.temperature).repeat_interleave(copies, 0)
    return functional.kl_div(
        got.log_softmax(1), wanted.log_softmax(1), log_target=True, reduction="batchmean"
    )


def train_jpeg_distil(
    source: Path | str | Traverse,
    folder: Path,
    settings: DistilSettings | None = None,
    *,
    start: Path | str | None = None,
    check: Path | None = None,
    limit: int = 0,
    resume: bool = False,
    parameters: dict[str, object] | None = None,
    progress: Progress = no_progress,
) -> Outcome:
    """Tune a technique's network without labels; write weights, summary and page to a folder.

    Parameters
    ----------
    source : Path, str or Traverse
        Pictures: a folder (of folders), or any drive.
    folder : Path
        Where everything goes; made if need be.
    settings : DistilSettings, optional
    start : Path or str, optional
        Weights to begin with, of an earlier tuning: a file, or a name such as ``"jpeg"``. What is
        learned stays the original's answers.
    check : Path, optional
        A folder of other pictures to measure on, before and after.
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
        If settings do not fit, or the folder holds another training.
    """
    settings = settings or DistilSettings()
    technique = learned_technique(settings.technique, parameters or {})
    pictures = load_pictures(source, limit=limit, progress=progress)
    task = JpegDistil(technique, pictures, settings, start)
    folder.mkdir(parents=True, exist_ok=True)
    trained = run_loop(task, settings.loop, folder, resume=resume, progress=progress)
    tuned = trained.network.network
    assert isinstance(tuned, torch.nn.Module)
    tensors = unfolded_state(tuned, technique.network())
    figures: Mapping[str, float] = {}
    if check is not None:
        held_out = load_pictures(check, progress=progress)
        figures = retrieval_figures(technique, tuned, held_out, progress=progress)
    name = getattr(source, "source", str(source))
    return write_outcome(
        folder,
        title=f"{settings.technique} tuned without labels to not mind JPEG",
        tensors=tensors,
        trained=trained,
        settings=settings,
        source=f"{len(pictures)} pictures of {Path(name).name}",
        figures=figures,
        clean_weights=_began_with(technique),
    )


def _began_with(technique: LearnedTechnique) -> str:
    """Return the name of the original's weights; "" for a file, which may not be there later."""
    name = str(technique.parameters.weights)
    return name if is_name(name) else ""
