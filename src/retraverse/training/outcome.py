"""What a training leaves in its folder: weights, losses, settings, a page."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from retraverse._version import __version__
from retraverse.files import write_whole
from retraverse.training.loop import Trained
from retraverse.training.report import write_training_report
from retraverse.weights.store import CLEAN_WEIGHTS

__all__ = ["Outcome", "write_outcome"]

WEIGHTS = "weights.safetensors"
SUMMARY = "training.json"
REPORT = "report.html"


@dataclass(frozen=True)
class Outcome:
    """Files of a finished training, and its figures."""

    weights: Path
    """safetensors; a technique takes it as ``weights=PATH``."""
    report: Path
    """A page with the settings and the loss."""
    summary: Path
    """JSON of settings, figures and versions."""
    figures: Mapping[str, float]
    """What was measured, by name."""


def write_outcome(
    folder: Path,
    *,
    title: str,
    tensors: Mapping[str, Tensor],
    trained: Trained,
    settings: Any,
    source: str,
    figures: Mapping[str, float],
    half: bool = True,
    clean_weights: str = "",
) -> Outcome:
    """Write weights (as float16 unless told otherwise), summary and page; each whole.

    Parameters
    ----------
    folder : Path
    title : str
        What was trained, for the page.
    tensors : mapping of name to Tensor
        Names as the network's published weights have them.
    trained : Trained
    settings : dataclass
    source : str
        The pictures, in words.
    figures : mapping of name to float
    half : bool
        Whether floats are stored as float16.
    clean_weights : str
        Name of the weights that serve clean pictures better; "" = none do.
    """
    from safetensors.numpy import save

    arrays = {name: _stored(tensor, half) for name, tensor in tensors.items()}
    about = {
        "training": title,
        "settings": asdict(settings),
        "pictures": source,
        "figures": {**figures, "loss, last tenth": _tail(trained.losses)},
        "steps": len(trained.losses),
        "versions": {"retraverse": __version__, "torch": torch.__version__},
    }
    text = {name: json.dumps(value) for name, value in about.items()}
    if clean_weights:
        text[CLEAN_WEIGHTS] = clean_weights
    write_whole(folder / WEIGHTS, save(arrays, text))
    summary = {**about, "losses": [float(f"{loss:.6g}") for loss in trained.losses]}
    write_whole(folder / SUMMARY, json.dumps(summary, indent=1).encode())
    write_training_report(folder / REPORT, about, trained.losses)
    return Outcome(folder / WEIGHTS, folder / REPORT, folder / SUMMARY, about["figures"])  # type: ignore[arg-type]


def _stored(tensor: Tensor, half: bool) -> Any:
    array = tensor.detach().cpu().numpy()
    as_half = half and array.dtype == np.float32
    return np.ascontiguousarray(array.astype(np.float16) if as_half else array)


def _tail(losses: tuple[float, ...]) -> float:
    """Return the mean loss of the last tenth of the steps."""
    return float(np.mean(losses[-max(1, len(losses) // 10) :])) if losses else float("nan")
