"""RegionVLAD: regions of interest in the maps of a middle layer, described by a vocabulary."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from retraverse.errors import DataMissingError, InputError
from retraverse.files import check_writable_place, write_whole
from retraverse.images import Frame
from retraverse.techniques.base import ArraySpec, Description, Layout
from retraverse.techniques.networks.caffe_tables import CAFFENET, graph_of, output_shape, until
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.caffe_input import (
    MEAN_COLOUR,
    ChannelOrder,
    find_mean,
    in_order,
    read_mean,
    smooth,
)
from retraverse.techniques.preparing.network_input import channels_first
from retraverse.techniques.registry import register
from retraverse.techniques.running.file_digest import file_digest
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.techniques.summarising.regions import (
    build_clusters,
    region_features,
    vlad_of_regions,
)
from retraverse.types import Array, FloatArray, ImageArray, Progress, no_progress
from retraverse.weights.store import find_weights, load_tensors

if TYPE_CHECKING:
    from collections.abc import Iterable

    import torch

__all__ = ["RegionVlad", "RegionVladParameters", "build_vocabulary"]

_INPUT = (3, 227, 227)
_TABLE = until(CAFFENET, "relu3")
_CHANNELS, _, _ = output_shape(_TABLE, _INPUT)
_TENSOR = "centres"


@dataclass(frozen=True)
class RegionVladParameters(LearnedParameters):
    """Which weights and vocabulary, how many regions and words."""

    weights: str = parameter(
        "alexnet-places365", "name of stored weights, or the path of a .caffemodel", compared=False
    )
    vocabulary: str = parameter(
        "regionvlad-vocabulary",
        "vocabulary of `retraverse train regionvlad`: a stored name, or a path of a .safetensors",
        compared=False,
    )
    words: int = parameter(256, "words of the vocabulary, 2 to 4096")
    regions: int = parameter(400, "the strongest regions of a picture, 1 to 10000")
    mean: str = parameter(
        MEAN_COLOUR,
        "mean image: a name in the store, a path (.npy, .binaryproto), or colour = ImageNet's",
        compared=False,
    )
    channels: ChannelOrder = parameter(
        "rgb", "order of the channels: rgb as in VPR-Bench, bgr as trained"
    )

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        check_range("regionvlad words", self.words, 2, 4096)
        check_range("regionvlad regions", self.regions, 1, 10_000)


@register(RegionVladParameters)
class RegionVlad(LearnedTechnique):
    """The strongest 400 regions of conv3's maps, pooled into the VLAD of a vocabulary.

    One unit vector of words x 384; its dot product is the sum over words of the paper's.

    Notes
    -----
    Regions are the paper's: non-zero values that touch. VPR-Bench's program, with the version of
    scikit-image of its day, joins values of the same whole number instead, and where a picture has
    fewer than 400 regions it counts the missing ones as zeros; here they are left out. Of the mean
    image its colour is subtracted.

    References
    ----------
    Khaliq, Ehsan, Chen, Milford, McDonald-Maier: A Holistic Visual Place Recognition Approach
    Using Lightweight CNNs for Significant ViewPoint and Appearance Changes, T-RO 2020.
    """

    name: ClassVar[str] = "regionvlad"
    summary: ClassVar[str] = "regions of AlexNet's conv3 in a vocabulary: bears change of viewpoint"
    citation: ClassVar[str] = (
        "Khaliq, Ehsan, Chen, Milford, McDonald-Maier: A Holistic Visual Place Recognition "
        "Approach Using Lightweight CNNs for Significant ViewPoint and Appearance Changes, T-RO "
        "2020"
    )
    version: ClassVar[int] = 1

    def __init__(self, parameters: RegionVladParameters | None = None) -> None:
        parameters = parameters or RegionVladParameters()
        super().__init__(parameters)
        length = parameters.words * _CHANNELS
        self.layout = Layout("global", {"descriptor": ArraySpec((length,), "float32")})
        self._centres: FloatArray | None = None
        self._mean: FloatArray | None = None

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return 227 x 227 pixels, 0..255 less the mean image's colour."""
        with self._lock:
            if self._mean is None:
                mean = read_mean(find_mean(self.parameters.mean), _INPUT[1])
                self._mean = mean.mean(axis=(0, 1), dtype=np.float32)
        picture = in_order(smooth(image, _INPUT[1]), self.parameters.channels)
        return channels_first(picture - self._mean)

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Return the network cut after the ReLU of conv3."""
        from retraverse.techniques.networks.caffe_net import CaffeNet

        return CaffeNet(graph_of(_TABLE, _INPUT, "RegionVLAD"), tensors)

    def finish(self, outputs: FloatArray) -> list[Description]:
        """Return the VLAD of every picture's regions."""
        centres = self.vocabulary()
        return [{"descriptor": vlad_of_regions(self.regions(maps), centres)} for maps in outputs]

    def regions(self, maps: FloatArray) -> FloatArray:
        """Return what lies under the regions of one picture's maps, (regions, 384)."""
        return region_features(maps, self.parameters.regions)

    def maps(self, image: ImageArray) -> FloatArray:
        """Return the maps of one picture, (384, 13, 13)."""
        maps: FloatArray = self.runner()(self.prepare(image)[np.newaxis])[0]
        return maps

    def vocabulary(self) -> FloatArray:
        """Return the words, float32 (words, 384).

        Raises
        ------
        DataMissingError
            If the vocabulary is not there.
        InputError
            If it has another size.
        """
        with self._lock:
            if self._centres is None:
                self._centres = _read_vocabulary(self.vocabulary_path(), self.parameters.words)
            return self._centres

    def vocabulary_path(self) -> Path:
        """Return the vocabulary's file; DataMissingError says how to build one."""
        try:
            return find_weights(self.parameters.vocabulary)
        except DataMissingError as error:
            raise DataMissingError(
                f"vocabulary {self.parameters.vocabulary!r} is not here: build one from your own "
                "pictures with `retraverse train regionvlad DRIVE --out vocabulary.safetensors` "
                "and set the parameter vocabulary to that file"
            ) from error

    def fingerprint(self) -> str:
        """Return the SHA-256 of the checksums of weights, vocabulary and mean image."""
        mean = find_mean(self.parameters.mean)
        parts = (
            super().fingerprint(),
            file_digest(self.vocabulary_path()),
            file_digest(mean) if mean else self.parameters.mean,
        )
        return hashlib.sha256("".join(parts).encode()).hexdigest()


def build_vocabulary(
    frames: "Iterable[Frame]",
    path: Path | str,
    *,
    technique: RegionVlad | None = None,
    most_features: int = 100_000,
    seed: int = 0,
    progress: Progress = no_progress,
) -> Path:
    """Build the vocabulary of the user's own pictures and write it as safetensors.

    Parameters
    ----------
    frames : Traverse or iterable of Frame
        Pictures of places like those to recognise, but better not the same ones.
    path : Path or str
        The file to write; it is whole or as before.
    technique : RegionVlad, optional
        Says weights, number of words and of regions.
    most_features : int
        Of more regions than these, a random part of every picture's is used.
    seed : int
        Of the choice and the clustering.

    Returns
    -------
    path : Path

    Raises
    ------
    InputError
        If the pictures have too few regions for so many words.
    """
    from safetensors.numpy import save

    technique, path, listed = technique or RegionVlad(), Path(path), list(frames)
    check_writable_place(path)
    random = np.random.default_rng(seed)
    share = max(1, most_features // max(1, len(listed)))
    features = [np.empty((0, _CHANNELS), np.float32)]
    for frame in progress(listed, total=len(listed), label="finding regions"):
        found = technique.regions(technique.maps(technique.read(frame)))
        features.append(random.permutation(found)[:share])
    centres = build_clusters(np.concatenate(features), technique.parameters.words, seed=seed)
    # One entry: safetensors writes several in an order that differs from run to run.
    metadata = {"made": f"RegionVLAD vocabulary, {len(listed)} pictures, seed {seed}"}
    write_whole(path, save({_TENSOR: centres}, metadata=metadata))
    return path


def _read_vocabulary(path: Path, words: int) -> FloatArray:
    tensors = load_tensors(path).tensors
    centres = tensors.get(_TENSOR)
    if centres is None or centres.shape != (words, _CHANNELS):
        got = "no centres" if centres is None else f"centres of shape {centres.shape}"
        raise InputError(
            f"vocabulary {path}: got {got}, expected ({words}, {_CHANNELS}); built with another "
            "number of words? (parameter words)"
        )
    return np.asarray(centres, dtype=np.float32)
