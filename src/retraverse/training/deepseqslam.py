"""DeepSeqSLAM's LSTM, trained on the drive of the map: one class a window of K frames.

The technique's CNN describes every frame once; the LSTM learns which window it sees. One drive
shows every place once only, so what it is shown is disturbed: noise on the descriptors and a
changed length of the steps stand in for another day.

References
----------
Chancán, Milford: DeepSeqSLAM: A Trainable CNN+RNN for Joint Global Description and Sequence-based
Place Recognition, 2020, section 3. The disturbances are ours.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from retraverse.errors import ConfigError, InputError
from retraverse.images import Traverse, open_traverse
from retraverse.techniques import technique
from retraverse.techniques.deepseqslam import DeepSeqSlam, frame_positions
from retraverse.techniques.networks.deepseqslam import (
    HIDDEN,
    DeepSeqSlamNet,
    PositionMode,
    window_positions,
    windows,
)
from retraverse.training.loop import LoopSettings, run_loop
from retraverse.training.outcome import Outcome, write_outcome
from retraverse.types import Array, FloatArray, Progress, no_progress

__all__ = ["DeepSeqSettings", "DeepSeqSlamTask", "train_deepseqslam"]

_AT_ONCE = 16


@dataclass(frozen=True)
class DeepSeqSettings:
    """How the LSTM is trained."""

    sequence_length: int = 10
    """K."""
    position: PositionMode = "relative"
    """``relative``: the way since the window's first frame; ``absolute``: as published."""
    hidden: int = HIDDEN
    """Units of the LSTM."""
    windows: int = 64
    """In a batch."""
    noise: float = 1.0
    """Deviation of the noise on descriptors, as a multiple of their own deviation over the
    drive."""
    loop: LoopSettings = field(
        default_factory=lambda: LoopSettings(steps=1500, learning_rate=1e-3, half_precision=False)
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("sequence_length", "hidden", "windows"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: got {getattr(self, name)}, expected at least 1")
        if self.noise < 0:
            raise ConfigError(f"noise: got {self.noise}, expected 0 or more")


class DeepSeqSlamTask:
    """The task: see the module.

    Parameters
    ----------
    descriptors : float32 array, shape (N, D)
    positions : float array, shape (N, 2)
    settings : DeepSeqSettings
    """

    def __init__(self, descriptors: Array, positions: Array, settings: DeepSeqSettings) -> None:
        n_places = len(descriptors) - settings.sequence_length + 1
        if n_places < 2:
            raise InputError(
                f"deepseqslam: got a drive of {len(descriptors)} frames, expected at least "
                f"{settings.sequence_length + 1}: two windows of K = {settings.sequence_length}"
            )
        self.settings = settings
        length = settings.sequence_length
        self._seen: FloatArray = windows(np.asarray(descriptors, np.float32), length)
        self._where = window_positions(positions, length, settings.position)
        self._deviation = np.asarray(descriptors, np.float32).std(axis=0) * settings.noise
        torch.manual_seed(settings.loop.seed)
        self.network = DeepSeqSlamNet(
            descriptors.shape[1],
            n_places,
            length,
            hidden=settings.hidden,
            position=settings.position,
        )

    def batch(self, step: int, random: np.random.Generator) -> tuple[Tensor, Tensor, Tensor]:
        """Return disturbed windows, their positions, and which windows they are."""
        places = random.integers(0, len(self._seen), self.settings.windows)
        seen = self._seen[places]
        noise = random.standard_normal(seen.shape, np.float32) * self._deviation
        disturbed = seen + noise * random.random((len(places), 1, 1), np.float32)
        where = self._where[places]
        if self.settings.position == "relative":
            where = where * random.uniform(0.8, 1.25, (len(places), 1, 1)).astype(np.float32)
        return torch.from_numpy(disturbed), torch.from_numpy(where), torch.from_numpy(places)

    def loss(self, batch: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        """Return the mean cross entropy."""
        seen, where, places = batch
        return functional.cross_entropy(self.network(seen, where).float(), places)

    def share_right(self) -> float:
        """Return the share of the drive's own windows that the network names right."""
        with torch.inference_mode():
            scores = self.network(torch.from_numpy(self._seen), torch.from_numpy(self._where))
        return float((scores.argmax(dim=1) == torch.arange(len(scores))).float().mean())

    def identity(self) -> dict[str, Any]:
        """Return settings, and sizes of the drive."""
        settings = asdict(self.settings)
        del settings["loop"]
        return {**settings, "places": len(self._seen), "dimension": self._seen.shape[2]}


def train_deepseqslam(
    source: Path | str | Traverse,
    folder: Path,
    settings: DeepSeqSettings | None = None,
    *,
    positions: Array | None = None,
    resume: bool = False,
    parameters: dict[str, object] | None = None,
    progress: Progress = no_progress,
) -> Outcome:
    """Train DeepSeqSLAM on a map's drive; write weights, summary and page to a folder.

    Parameters
    ----------
    source : Path, str or Traverse
        The drive the map is of, frame by frame the same.
    folder : Path
        Where everything goes; made if need be.
    settings : DeepSeqSettings, optional
    positions : float array, shape (N, 2), optional
        Of every frame, in any unit; by default one step a frame.
    resume : bool
        Go on from the folder's checkpoint.
    parameters : dict, optional
        Of the technique: its ``cnn``, say.
    progress : Progress

    Raises
    ------
    InputError
        If the drive is shorter than two windows, or the folder holds another training.
    """
    settings = settings or DeepSeqSettings()
    deepseqslam = technique("deepseqslam", **(parameters or {}))
    assert isinstance(deepseqslam, DeepSeqSlam)
    drive = source if isinstance(source, Traverse) else open_traverse(source)
    descriptors = _described(deepseqslam, drive, progress)
    where = frame_positions(len(drive)) if positions is None else positions
    task = DeepSeqSlamTask(descriptors, where, settings)
    folder.mkdir(parents=True, exist_ok=True)
    trained = run_loop(task, settings.loop, folder, resume=resume, progress=progress)
    assert isinstance(trained.network, DeepSeqSlamNet)
    return write_outcome(
        folder,
        title=f"DeepSeqSLAM on {drive.name}",
        tensors=trained.network.state_dict(),
        trained=trained,
        settings=settings,
        source=f"{len(drive)} frames of {drive.name}, by {deepseqslam.parameters.cnn}",
        figures={"own windows named right": task.share_right()},
        half=False,
    )


def _described(deepseqslam: DeepSeqSlam, drive: Traverse, progress: Progress) -> FloatArray:
    rows: list[Array] = []
    starts = range(0, len(drive), _AT_ONCE)
    for start in progress(starts, total=len(starts), label="describing"):
        images = [deepseqslam.read(frame) for frame in drive[start : start + _AT_ONCE]]
        rows += [one["descriptor"] for one in deepseqslam.describe_batch(images)]
    return np.stack(rows).astype(np.float32)
