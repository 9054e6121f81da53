"""How well pictures are found again through JPEG: measured on pictures kept out of a training.

A stand-in for real drives, so that settings can be chosen without looking at any drive that
results are reported on. Each picture is a short drive of six steps, nearer each time,
seen a second time moved aside and in another light; the second time is compressed, the first
too or not. A query is right where both picture and step are.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import nn

from retraverse.techniques.running.learned import LearnedTechnique
from retraverse.training.pictures import View, seen_through_jpeg, take_view
from retraverse.training.tuned_network import as_input
from retraverse.types import FloatArray, ImageArray, Progress, no_progress

__all__ = ["CONDITIONS", "retrieval_figures"]

CONDITIONS: dict[str, tuple[int | None, int | None]] = {
    "clean": (None, None),
    "c = 97": (97, 97),
    "query clean, map c = 97": (None, 97),
}
"""Name -> c of the second time and of the first."""
SIZES = ((160, 120), (97, 54), (224, 224))
"""Width and height in pixels before compression."""
_NEARER = (1.0, 0.92, 0.85, 0.78, 0.72, 0.66)
_AT_ONCE = 16
LARGEST_SET = 70
"""Pictures that are taken at most."""


def retrieval_figures(
    technique: LearnedTechnique,
    tuned: nn.Module,
    pictures: Sequence[ImageArray],
    *,
    seed: int = 7,
    progress: Progress = no_progress,
) -> Mapping[str, float]:
    """Return the share found again, for the original and the tuned network.

    Parameters
    ----------
    technique : LearnedTechnique
        Prepares pictures and pools outputs; has the original network.
    tuned : nn.Module
    pictures : sequence of uint8 RGB arrays
        None of those trained on; at most 140 are taken, spread evenly.
    seed : int
        Of the second look's movement and light.

    Returns
    -------
    figures : mapping
        ``"tuned, 160 x 120, c = 97"`` -> share in [0, 1], and so on.
    """
    few = [pictures[i] for i in range(0, len(pictures), -(-len(pictures) // LARGEST_SET))]
    networks = {"untuned": technique.network(), "tuned": tuned.eval()}
    work = [(name, size) for name in networks for size in SIZES]
    figures: dict[str, float] = {}
    for name, size in progress(work, total=len(work), label="measuring"):
        shares = _shares_found(technique, networks[name], _looks(few, size, seed))
        width, height = size
        figures |= {f"{name}, {width} x {height}, {what}": one for what, one in shares.items()}
    return figures


def _looks(
    pictures: Sequence[ImageArray], size: tuple[int, int], seed: int
) -> tuple[list[ImageArray], list[ImageArray]]:
    """Return all second and all first looks."""
    random = np.random.default_rng(seed)
    queries, references = [], []
    for picture in pictures:
        for nearer in _NEARER:
            first = _central(picture, size, nearer)
            references.append(take_view(picture, first, np.random.default_rng(0)))
            second = _moved(first, picture, random)
            queries.append(take_view(picture, second, np.random.default_rng(0)))
    return queries, references


def _central(picture: ImageArray, size: tuple[int, int], nearer: float) -> View:
    tall, wide = picture.shape[:2]
    ratio = size[0] / size[1]
    width = int(min(0.9 * wide, 0.9 * tall * ratio) * nearer)
    height = int(min(tall, width / ratio))
    left, top = (wide - width) // 2, (tall - height) // 2
    return View(left, top, width, height, size, False, False, 1.0, 1.0)


def _moved(view: View, picture: ImageArray, random: np.random.Generator) -> View:
    tall, wide = picture.shape[:2]
    aside, up = random.integers(-wide // 10, wide // 10 + 1), random.integers(-6, 7)
    left = int(np.clip(view.left + aside, 0, wide - view.width))
    top = int(np.clip(view.top + up, 0, tall - view.height))
    gamma = float(np.exp(random.uniform(-0.7, 0.7)))
    return View(left, top, view.width, view.height, view.size, False, False, 1.0, gamma)


def _shares_found(
    technique: LearnedTechnique,
    network: nn.Module,
    looks: tuple[list[ImageArray], list[ImageArray]],
) -> dict[str, float]:
    """Return the share found again under each condition; no picture is described twice."""
    known: dict[tuple[int, int | None], FloatArray] = {}
    shares = {}
    for what, compressions in CONDITIONS.items():
        for side, compression in enumerate(compressions):
            if (side, compression) not in known:
                seen = [seen_through_jpeg(look, compression) for look in looks[side]]
                known[side, compression] = _vectors(technique, network, seen)
        queries, references = (known[side, compressions[side]] for side in (0, 1))
        best = (queries @ references.T).argmax(axis=1)
        shares[what] = float((best == np.arange(len(best))).mean())
    return shares


@torch.inference_mode()
def _vectors(
    technique: LearnedTechnique, network: nn.Module, pictures: Sequence[ImageArray]
) -> FloatArray:
    from retraverse.techniques.summarising.pooling import unit_rows

    rows = []
    for start in range(0, len(pictures), _AT_ONCE):
        batch = as_input(technique, pictures[start : start + _AT_ONCE])
        with torch.autocast("cpu", torch.bfloat16):
            outputs = network(batch)
        rows.append(unit_rows(technique.pool(outputs.float().numpy())))
    return np.concatenate(rows)
