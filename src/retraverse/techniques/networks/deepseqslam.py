"""DeepSeqSLAM's own part: what a CNN saw in K frames, and where, to the place the window is at.

The CNN is frozen and described beforehand; this network learns one drive, the map's: place r is
the window of its frames r to r + K - 1.

Conventions
- Descriptors are float32 (B, K, D), positions float32 (B, K, 2) in any unit; out come one score a
  place, (B, places), before the softmax.
- `window_positions` makes positions fit for the network. ``relative``: the way since the window's
  first frame, as odometry has it. ``absolute``: as published, scaled from -1000 to 1000 over the
  drive; a network may then read the place off the position and never look at the picture.
- The state is self-contained: `DeepSeqSlamNet.from_tensors` needs nothing but the tensors.

References
----------
Chancán, Milford: DeepSeqSLAM: A Trainable CNN+RNN for Joint Global Description and Sequence-based
Place Recognition, 2020, section 3: an LSTM of 512 units on the concatenation, one linear layer.
"""

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import ConfigError
from retraverse.techniques.networks.loading import load_checked, tensor_named
from retraverse.types import Array, FloatArray

__all__ = ["HIDDEN", "POSITIONS", "DeepSeqSlamNet", "PositionMode", "window_positions", "windows"]

HIDDEN = 512
"""Units of the published LSTM."""
PositionMode = Literal["relative", "absolute"]
POSITIONS: tuple[PositionMode, ...] = ("relative", "absolute")
_PUBLISHED_RANGE = 1000.0
_OWNER = "DeepSeqSLAM"


class DeepSeqSlamNet(nn.Module):
    """The LSTM and its classifier.

    Parameters
    ----------
    dimension : int
        D, of the CNN's descriptor.
    places : int
        Windows of the drive it learns: frames - K + 1.
    sequence_length : int
        K.
    hidden : int
        Units of the LSTM.
    position : {"relative", "absolute"}
        Which positions it is trained with; kept in its state.
    """

    sequence_length: Tensor
    position: Tensor

    def __init__(
        self,
        dimension: int,
        places: int,
        sequence_length: int,
        *,
        hidden: int = HIDDEN,
        position: PositionMode = "relative",
    ) -> None:
        super().__init__()
        if min(dimension, places, sequence_length, hidden) < 1:
            raise ConfigError(
                f"{_OWNER}: got dimension {dimension}, places {places}, sequence length "
                f"{sequence_length}, hidden {hidden}; expected 1 or more of each "
                "(a drive shorter than the sequence?)"
            )
        self.lstm = nn.LSTM(dimension + 2, hidden, batch_first=True)
        self.head = nn.Linear(hidden, places)
        self.register_buffer("sequence_length", torch.tensor(sequence_length))
        self.register_buffer("position", torch.tensor(POSITIONS.index(position)))

    @classmethod
    def from_tensors(cls, tensors: Mapping[str, Any]) -> Self:
        """Return the network of a saved state: every size is in its tensors.

        Raises
        ------
        InputError
            If a tensor is missing or of another shape.
        """
        units, width = np.shape(tensor_named(tensors, "lstm.weight_ih_l0", _OWNER))
        places = len(tensor_named(tensors, "head.bias", _OWNER))
        network = cls(width - 2, places, 1, hidden=units // 4)
        load_checked(network, tensors, _OWNER)
        return network

    @property
    def position_mode(self) -> PositionMode:
        """Which positions it was trained with."""
        return POSITIONS[int(self.position)]

    @property
    def n_frames(self) -> int:
        """Frames of the drive it learned."""
        return self.head.out_features + int(self.sequence_length) - 1

    def forward(self, descriptors: Tensor, positions: Tensor) -> Tensor:
        """Return one score a place, (B, places), from the state after the window's last frame."""
        states, _ = self.lstm(torch.cat([descriptors, positions], dim=2))
        scores: Tensor = self.head(states[:, -1])
        return scores


def windows(frames: Array, length: int) -> Array:
    """Return every window of `length` consecutive frames, (N - length + 1, length, ...)."""
    starts = np.arange(len(frames) - length + 1)
    return np.asarray(frames[starts[:, np.newaxis] + np.arange(length)])


def window_positions(positions: Array, length: int, mode: PositionMode) -> FloatArray:
    """Return the positions of every window as the network takes them.

    Parameters
    ----------
    positions : float array, shape (N, 2)
        Of every frame of a drive, in any unit; without odometry ``(frame, 0)``.
    length : int
        K.
    mode : {"relative", "absolute"}

    Returns
    -------
    float32 array, shape (N - K + 1, K, 2)
        Relative: the way since the first frame, in mean steps of the drive, divided by K.
        Absolute: each axis from -1000 to 1000 over the drive.
    """
    exact = np.asarray(positions, np.float64)
    if mode == "absolute":
        low, extent = exact.min(axis=0), np.ptp(exact, axis=0)
        scaled = (exact - low) / np.where(extent > 0, extent, 1) * 2 - 1
        return np.asarray(windows(scaled * _PUBLISHED_RANGE, length), np.float32)
    steps = np.linalg.norm(np.diff(exact, axis=0), axis=1)
    step = steps.mean() if len(steps) and steps.any() else 1.0
    cut = windows(exact, length)
    return np.asarray((cut - cut[:, :1]) / (step * length), np.float32)
