"""NetVLAD's clusters and whitening from the drive of a map: no training by gradients.

VGG16 stays as it is. Local features of the drive's pictures are clustered by k-means, which gives
the layer its centres and, as at the start of NetVLAD's own training, its assignment; the vectors
of all pictures give a PCA with whitening. For a drive unlike the streets that the published
weights were trained on.

References
----------
Arandjelović, Gronat, Torii, Pajdla, Sivic: NetVLAD: CNN architecture for weakly supervised place
recognition, CVPR 2016, section 3.1 and appendix A (how the layer starts); Arthur, Vassilvitskii:
k-means++: The Advantages of Careful Seeding, SODA 2007; Jégou, Chum: Negative evidences and
co-occurrences in image retrieval: the benefit of PCA and whitening, ECCV 2012.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import ConfigError, InputError
from retraverse.files import write_whole
from retraverse.images import Traverse, open_traverse
from retraverse.techniques import technique
from retraverse.techniques.netvlad import NetVlad
from retraverse.techniques.networks.vgg_netvlad import VggNetVlad
from retraverse.training.loop import Trained
from retraverse.training.outcome import Outcome, write_outcome
from retraverse.types import Array, FloatArray, Progress, no_progress
from retraverse.weights.store import load_tensors

__all__ = [
    "NetVladSettings",
    "assignment_sharpness",
    "first_centres",
    "moved_centres",
    "train_netvlad",
    "whitening",
]

CHECKPOINT = "checkpoint.safetensors"
_UNWHITENED = 32768
_SOFT_RATIO = 100.0
"""The nearest centre gets so many times the share of the second nearest, on average."""


@dataclass(frozen=True)
class NetVladSettings:
    """How clusters and PCA are made."""

    per_picture: int = 100
    """Local features of each picture that are clustered."""
    iterations: int = 30
    """Of k-means at most."""
    dimension: int = 4096
    """Numbers kept after the PCA; at most one less than there are pictures."""
    checkpoint_every: int = 25
    """Pictures between checkpoints."""
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("per_picture", "iterations", "dimension", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: got {getattr(self, name)}, expected at least 1")


def train_netvlad(
    source: Path | str | Traverse,
    folder: Path,
    settings: NetVladSettings | None = None,
    *,
    resume: bool = False,
    parameters: dict[str, object] | None = None,
    progress: Progress = no_progress,
) -> Outcome:
    """Make NetVLAD's clusters and PCA from a drive; write weights, summary and page to a folder.

    Parameters
    ----------
    source : Path, str or Traverse
        The drive of the map.
    folder : Path
        Where everything goes; made if need be.
    settings : NetVladSettings, optional
    resume : bool
        Go on from the folder's checkpoint.
    parameters : dict, optional
        Of the technique `netvlad`: its ``weights``, whose VGG16 is taken, and the pictures' size.
    progress : Progress

    Raises
    ------
    DataMissingError
        If VGG16's weights are not here.
    InputError
        If the drive has fewer than three pictures or too few local features.
    """
    settings = settings or NetVladSettings()
    netvlad = technique("netvlad", **{**(parameters or {}), "dimension": _UNWHITENED})
    assert isinstance(netvlad, NetVlad)
    drive = source if isinstance(source, Traverse) else open_traverse(source)
    if len(drive) < 3:
        raise InputError(f"netvlad: got a drive of {len(drive)} pictures, expected at least 3")
    identity = json.dumps([asdict(settings), netvlad.fingerprint(), len(drive)])
    folder.mkdir(parents=True, exist_ok=True)
    stages = _Stages(folder / CHECKPOINT, identity, resume)
    network = netvlad.network()
    assert isinstance(network, VggNetVlad)
    looks = _Looks(netvlad, network, drive)
    local = _sampled(looks, settings, stages, progress)
    centres, errors = _clustered(local, network.vlad.centres.shape[0], settings, stages, progress)
    _set_clusters(network, centres, local)
    vectors = _vectors(looks, settings, stages, progress)
    matrix, shift = whitening(vectors, settings.dimension)
    tensors = dict(network.state_dict())
    tensors |= {
        "whitening.weight": torch.from_numpy(matrix),
        "whitening.bias": torch.from_numpy(shift),
    }
    return write_outcome(
        folder,
        title=f"NetVLAD's clusters and PCA of {drive.name}",
        tensors=tensors,
        trained=Trained(network, tuple(errors), 0),
        settings=settings,
        source=f"{len(drive)} pictures of {drive.name}, {len(local)} local features",
        figures={"dimension": float(len(matrix)), "clusters": float(len(centres))},
        half=False,
    )


def first_centres(points: FloatArray, count: int, random: np.random.Generator) -> FloatArray:
    """Return k-means++'s first centres, (count, D): far ones are likelier.

    Raises
    ------
    InputError
        If there are fewer different points than centres.
    """
    centres = [points[random.integers(len(points))]]
    distance = np.full(len(points), np.inf)
    for _ in range(count - 1):
        distance = np.minimum(distance, np.square(points - centres[-1]).sum(axis=1))
        total = distance.sum(dtype=np.float64)
        if total <= 0:
            raise InputError(
                f"netvlad: got {len(centres)} different local features, expected at least {count}: "
                "pictures of one colour?"
            )
        centres.append(points[random.choice(len(points), p=distance.astype(np.float64) / total)])
    return np.stack(centres)


def moved_centres(points: FloatArray, centres: FloatArray) -> tuple[FloatArray, float]:
    """Return each centre at the mean of the points nearest to it, and their mean distance squared.

    A centre that no point is nearest to stays where it is.
    """
    nearest, distance = _nearest(points, centres)
    moved = centres.copy()
    for number in np.unique(nearest):
        moved[number] = points[nearest == number].mean(axis=0)
    return moved, float(distance.mean())


def assignment_sharpness(points: FloatArray, centres: FloatArray) -> float:
    """Return alpha of equation 3: the nearest centre gets 100 times the second's share."""
    ordered = np.sort(_squared_distances(points, centres), axis=1)
    gap = float((ordered[:, 1] - ordered[:, 0]).mean())
    return float(np.log(_SOFT_RATIO) / max(gap, 1e-12))


def whitening(vectors: FloatArray, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Return matrix (d, D) and shift (d,) that take vectors to uncorrelated ones of variance 1.

    Parameters
    ----------
    vectors : float32 array, shape (N, D)
    dimension : int
        d is this or N - 1, whichever is less; directions without variance are left out.
    """
    mean = vectors.mean(axis=0, dtype=np.float64)
    centred = vectors - mean
    # N is far below D: the small Gram matrix has the same components.
    values, left = np.linalg.eigh(centred @ centred.T)
    order = np.argsort(values)[::-1][: min(dimension, len(vectors) - 1)]
    order = order[values[order] > values.max() * 1e-9]
    axes = (left[:, order].T @ centred) / np.sqrt(values[order])[:, np.newaxis]
    scale = np.sqrt(len(vectors) / values[order])
    matrix = axes * scale[:, np.newaxis]
    return matrix.astype(np.float32), (-matrix @ mean).astype(np.float32)


@dataclass(frozen=True)
class _Looks:
    """The drive through VGG16."""

    technique: NetVlad
    network: VggNetVlad
    drive: Traverse

    @torch.inference_mode()
    def features(self, number: int) -> Tensor:
        """Return the unit local features of one picture, (1, 512, h, w)."""
        image = self.technique.prepare(self.technique.read(self.drive[number]))
        features = self.network.features(torch.from_numpy(image[np.newaxis]))
        return nn.functional.normalize(features, dim=1)


class _Stages:
    """What is finished: arrays in one file, written whole after every piece of work."""

    def __init__(self, path: Path, identity: str, resume: bool) -> None:
        self._path, self._identity = path, identity
        self.arrays: dict[str, Array] = {}
        if not path.exists():
            return
        if not resume:
            raise InputError(
                f"{path}: a training was begun here; expected an empty folder (resume it, or "
                "choose another one)"
            )
        stored = load_tensors(path)
        if stored.metadata.get("identity") != identity:
            raise InputError(f"{path}: begun with other settings or another drive")
        self.arrays = dict(stored.tensors)

    def write(self, name: str, array: Array) -> None:
        """Keep an array, instead of an earlier one of its name."""
        from safetensors.numpy import save

        self.arrays[name] = np.ascontiguousarray(array)
        write_whole(self._path, save(self.arrays, {"identity": self._identity}))


def _by_picture(
    looks: _Looks,
    name: str,
    make: Callable[[int], Array],
    settings: NetVladSettings,
    stages: _Stages,
    progress: Progress,
) -> FloatArray:
    """Return `make` of every picture, stacked; goes on after those that are stored."""
    done = list(stages.arrays.get(name, []))
    numbers = range(len(done), len(looks.drive))
    for number in progress(numbers, total=len(numbers), label=name):
        done.append(make(number))
        if len(done) % settings.checkpoint_every == 0 or len(done) == len(looks.drive):
            stages.write(name, np.stack(done))
    return np.stack(done)


def _sampled(
    looks: _Looks, settings: NetVladSettings, stages: _Stages, progress: Progress
) -> FloatArray:
    """Return local features of all pictures, (N * per_picture, 512)."""

    def sample(number: int) -> Array:
        features = looks.features(number)[0].flatten(1).T.numpy()
        random = np.random.default_rng([settings.seed, number])
        chosen = random.integers(0, len(features), settings.per_picture)
        return np.asarray(features[chosen])

    sampled = _by_picture(looks, "local features", sample, settings, stages, progress)
    return sampled.reshape(-1, sampled.shape[-1])


def _clustered(
    local: FloatArray, count: int, settings: NetVladSettings, stages: _Stages, progress: Progress
) -> tuple[FloatArray, list[float]]:
    """Return the centres, and the mean distance squared at every iteration."""
    centres = stages.arrays.get("centres")
    errors = stages.arrays.get("errors", np.zeros(0)).tolist()
    if centres is None:
        centres = first_centres(local, count, np.random.default_rng(settings.seed))
    numbers = range(len(errors), settings.iterations)
    for _ in progress(numbers, total=len(numbers), label="clustering"):
        if len(errors) > 1 and errors[-2] - errors[-1] <= 1e-6 * errors[-1]:
            break
        centres, error = moved_centres(local, centres)
        errors.append(error)
        stages.arrays["errors"] = np.array(errors)
        stages.write("centres", centres)
    return centres, errors


@torch.no_grad()
def _set_clusters(network: VggNetVlad, centres: FloatArray, local: FloatArray) -> None:
    """Set the layer as equation 3 has it: weight 2 alpha c, bias -alpha |c|^2."""
    sharpness = assignment_sharpness(local, centres)
    own = torch.from_numpy(centres)
    network.vlad.centres.copy_(own)
    network.vlad.assignment.weight.copy_((2 * sharpness * own)[:, :, None, None])
    assert network.vlad.assignment.bias is not None
    network.vlad.assignment.bias.copy_(-sharpness * own.square().sum(dim=1))


def _vectors(
    looks: _Looks, settings: NetVladSettings, stages: _Stages, progress: Progress
) -> FloatArray:
    """Return the drive's unit vectors, (N, clusters * 512)."""

    def vector(number: int) -> Array:
        with torch.inference_mode():
            return np.asarray(looks.network.vlad(looks.features(number))[0].numpy())

    return _by_picture(looks, "vectors", vector, settings, stages, progress)


def _squared_distances(points: FloatArray, centres: FloatArray) -> Any:
    lengths = np.square(points).sum(axis=1)[:, np.newaxis] + np.square(centres).sum(axis=1)
    return np.maximum(lengths - 2 * points @ centres.T, 0)


def _nearest(points: FloatArray, centres: FloatArray) -> tuple[Array, Array]:
    distances = _squared_distances(points, centres)
    nearest = distances.argmin(axis=1)
    return nearest, distances[np.arange(len(points)), nearest]
